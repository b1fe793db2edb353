"""The sizes of browser windows, and how tests open one."""

from collections.abc import Callable
from typing import Any

import pytest
from playwright.sync_api import BrowserContext

DESKTOP: dict[str, Any] = {"viewport": {"width": 1280, "height": 900}}
PHONE: dict[str, Any] = {"viewport": {"width": 390, "height": 844}, "is_mobile": True, "has_touch": True}

TIMEOUT_MS = 15_000

OpenContext = Callable[..., BrowserContext]

OPENED: pytest.StashKey[list[BrowserContext]] = pytest.StashKey()
"""The windows of a module, for pictures of failures."""

# A page's own policy keeps it from loading anything else; this tells the test what the policy stopped.
_REPORT_VIOLATIONS = """document.addEventListener("securitypolicyviolation", (event) => {
    console.error(`CSP: ${event.violatedDirective} stopped ${event.blockedURI}`);
});"""


def watch(context: BrowserContext, complaints: list[str], expected: tuple[str, ...]) -> None:
    """Collect the errors of console, scripts and requests, but for those that a test provokes."""

    def complain(words: str) -> None:
        if not any(part in words for part in expected):
            complaints.append(words)

    context.add_init_script(_REPORT_VIOLATIONS)
    context.on("console", lambda message: complain(message.text) if message.type in {"error", "warning"} else None)
    context.on("weberror", lambda error: complain(str(error.error)))
    context.on("response", lambda answer: complain(f"{answer.status} {answer.url}") if answer.status >= 400 else None)
