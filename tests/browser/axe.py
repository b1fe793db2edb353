"""axe looks at a page on a large screen and on a phone, in light and in dark colours."""

import json

from playwright.sync_api import Page

from tests.browser.windows import DESKTOP, PHONE
from tests.conftest import ROOT

AXE = ROOT / "tests/vendor/axe-core/axe.min.js"
SIZES = {"desktop": DESKTOP["viewport"], "phone": PHONE["viewport"]}
LOOK = """async () => {
    const result = await window.axe.run(document, { resultTypes: ["violations"] });
    return result.violations.map((rule) => [rule.id, ...rule.nodes.map((node) => node.target.join(" "))]);
}"""


def assert_accessible(page: Page, name: str) -> None:
    """Fail with rules and elements if axe finds anything, whatever the size and the colours."""
    page.evaluate(AXE.read_text(encoding="utf-8"))
    found = {}
    for size, viewport in SIZES.items():
        page.set_viewport_size(viewport)
        for colours in ("light", "dark"):
            page.emulate_media(color_scheme=colours)
            violations = page.evaluate(LOOK)
            if violations:
                found[f"{name}, {size}, {colours}"] = violations
    assert not found, json.dumps(found, indent=1)
