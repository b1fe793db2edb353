"""The Firefox that people have, without a screen, driven by its own protocol: WebDriver BiDi, over a websocket."""

import json
import os
import re
import subprocess
import time
from base64 import b64decode
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from websockets.sync.client import ClientConnection, connect

TIMEOUT_S = 20.0
LOOK_S = 0.05
PHONE = {"width": 390, "height": 844}
_LISTENS = re.compile(r"WebDriver BiDi listening on (ws://\S+)")
_REPORT_VIOLATIONS = """() => document.addEventListener("securitypolicyviolation", (event) => {
    console.error(`CSP: ${event.violatedDirective} stopped ${event.blockedURI}`);
})"""
_BRING_INTO_SIGHT = """new Promise((done) => {
    const element = document.querySelector(%s);
    element.scrollIntoView({ block: "center", behavior: "instant" });
    requestAnimationFrame(() => requestAnimationFrame(() => done(element)));
})"""


class BidiError(Exception):
    """Firefox could not do what it was asked for."""


class Firefox:
    """One window, as large as a phone's.

    Attributes:
        complaints: What pages wrote to the console as errors and warnings, and what the server refused.
    """

    def __init__(self, connection: ClientConnection) -> None:
        self.complaints: list[str] = []
        self._connection = connection
        self._num_calls = 0
        self.call("session.new", capabilities={})
        self.call("session.subscribe", events=["log.entryAdded", "network.responseCompleted"])
        self.call("script.addPreloadScript", functionDeclaration=_REPORT_VIOLATIONS)
        self._window: str = self.call("browsingContext.getTree")["contexts"][0]["context"]
        self.call("browsingContext.setViewport", context=self._window, viewport=PHONE)

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:  # noqa: ANN401 - whatever the protocol has.
        """Send a command and return its result."""
        self._num_calls += 1
        self._connection.send(json.dumps({"id": self._num_calls, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._connection.recv(timeout=TIMEOUT_S))
            if message["type"] == "event":
                self._note(message["method"], message["params"])
            elif message["id"] == self._num_calls and message["type"] == "error":
                raise BidiError(f"{method}: {message['error']}: {message['message']}")
            elif message["id"] == self._num_calls:
                return dict(message["result"])

    def open(self, address: str) -> None:
        """Go to an address and wait until its page is loaded."""
        self.call("browsingContext.navigate", context=self._window, url=address, wait="complete")

    def evaluate(self, expression: str) -> Any:  # noqa: ANN401 - whatever can be written as JSON.
        """Return the value of a JavaScript expression."""
        return json.loads(self._run(f"JSON.stringify(({expression}) ?? null)")["value"])

    def wait_until(self, expression: str) -> None:
        """Wait until an expression is true; one page may give way to another meanwhile."""
        deadline = time.monotonic() + TIMEOUT_S
        while time.monotonic() < deadline:
            try:
                if self.evaluate(f"Boolean({expression})"):
                    return
            except BidiError:
                pass  # There is no page at the moment.
            time.sleep(LOOK_S)
        raise AssertionError(f"not so after {TIMEOUT_S} s: {expression}")

    def click(self, selector: str) -> None:
        """Move the pointer onto an element and press, again if Firefox scrolls back to what was typed last."""
        press = [{"type": kind, "button": 0} for kind in ("pointerDown", "pointerUp")]
        deadline = time.monotonic() + TIMEOUT_S
        while True:
            element = {"sharedId": self._run(_BRING_INTO_SIGHT % json.dumps(selector))["sharedId"]}
            to_it = {"type": "pointerMove", "x": 0, "y": 0, "origin": {"type": "element", "element": element}}
            mouse = {"type": "pointer", "id": "mouse", "actions": [to_it, *press]}
            try:
                self.call("input.performActions", context=self._window, actions=[mouse])
            except BidiError as error:
                if "out of bounds" not in str(error) or time.monotonic() > deadline:
                    raise
            else:
                return

    def press(self, *keys: str) -> None:
        """Press keys one after another; special ones are the code points that WebDriver gives them."""
        strokes = [{"type": kind, "value": key} for key in keys for kind in ("keyDown", "keyUp")]
        keyboard = {"type": "key", "id": "keyboard", "actions": strokes}
        self.call("input.performActions", context=self._window, actions=[keyboard])

    def save_picture(self, path: Path) -> None:
        """Write what the window shows as a PNG file."""
        path.write_bytes(b64decode(self.call("browsingContext.captureScreenshot", context=self._window)["data"]))

    def _run(self, expression: str) -> dict[str, Any]:
        told = self.call("script.evaluate", expression=expression, target={"context": self._window}, awaitPromise=True)
        if told["type"] == "exception":
            raise BidiError(f"{expression}: {told['exceptionDetails']['text']}")
        return dict(told["result"])

    def _note(self, event: str, told: dict[str, Any]) -> None:
        if event == "log.entryAdded" and told["level"] in {"error", "warn"}:
            self.complaints.append(str(told["text"]))
        elif event == "network.responseCompleted" and told["response"]["status"] >= 400:
            self.complaints.append(f"{told['response']['status']} {told['response']['url']}")


@contextmanager
def open_firefox(program: str, folder: Path) -> Iterator[Firefox]:
    """Start a Firefox that knows nothing, with its home in an empty folder, and end it in the end."""
    log = folder / "firefox.log"
    command = [program, "--headless", "--no-remote", "--remote-debugging-port", "0", "--profile", str(folder)]
    home = {**os.environ, "HOME": str(folder)}
    with log.open("w") as file, subprocess.Popen(command, env=home, stderr=file) as process:
        try:
            with connect(f"{_address(log)}/session", max_size=None, proxy=None) as connection:
                firefox = Firefox(connection)
                yield firefox
                firefox.call("browser.close")
            process.wait(TIMEOUT_S)
        finally:
            process.kill()


def _address(log: Path) -> str:
    deadline = time.monotonic() + TIMEOUT_S
    while time.monotonic() < deadline:
        found = _LISTENS.search(log.read_text(encoding="utf-8"))
        if found:
            return found[1]
        time.sleep(LOOK_S)
    raise AssertionError(f"Firefox does not listen: {log.read_text(encoding='utf-8')}")
