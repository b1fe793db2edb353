"""Templates, styles and scripts keep the strict content policy: nothing inline, nothing from elsewhere."""

import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
TEMPLATES = sorted((ROOT / "templates").rglob("*.html"))
OWN_FILES = sorted(
    path for path in (ROOT / "static").rglob("*.*") if "vendor" not in path.parts and path.suffix != ".ico"
)
# The name of a vocabulary, which nobody fetches.
NAMESPACES = ("http://www.w3.org/2000/svg",)


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


class Elements(HTMLParser):
    """Collects what a page would run or load."""

    def __init__(self) -> None:
        super().__init__()
        self.inline: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        names = {name for name, _ in attrs}
        if tag == "style" or (tag == "script" and "src" not in names) or "style" in names:
            self.inline.append(self.get_starttag_text() or tag)
        self.inline += [f"{tag} {name}" for name in names if re.match(r"on[a-z]", name)]


def addresses(text: str) -> Iterator[str]:
    yield from (address for address in re.findall(r"""https?://[^\s"')>]+""", text) if address not in NAMESPACES)
    yield from re.findall(r"""["'(](?:data|javascript):""", text)


@pytest.mark.parametrize("path", TEMPLATES, ids=name_of)
def test_no_template_holds_styles_or_scripts(path: Path) -> None:
    elements = Elements()
    elements.feed(re.sub(r"\{%.*?%\}|\{#.*?#\}", "", path.read_text(encoding="utf-8"), flags=re.DOTALL))
    assert elements.inline == []


@pytest.mark.parametrize("path", [*TEMPLATES, *OWN_FILES], ids=name_of)
def test_nothing_is_loaded_from_elsewhere(path: Path) -> None:
    assert list(addresses(path.read_text(encoding="utf-8"))) == []


@pytest.mark.parametrize("path", TEMPLATES, ids=name_of)
def test_no_template_switches_escaping_off(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert not re.search(r"\|\s*safe\b|autoescape", text)


def test_the_policy_tests_notice_what_they_forbid() -> None:
    elements = Elements()
    elements.feed('<p style="x"><b onclick="y"></b><script>z</script><style></style><script src="/a.js"></script>')
    assert len(elements.inline) == 4
    assert len(list(addresses("""<img src="https://example.org/a.png"> url('data:image/png;base64,AA')"""))) == 2
