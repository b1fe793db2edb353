"""Weigh and time what participants load, and let Lighthouse rate it; fail if a promise is broken.

python -m tests.benchmarks.pages

Three pages of the study `understanding`, which has everything around its trials: the welcome, a trial's explanation
with its ratings, and a drive. Everything is weighed with an empty cache. Lighthouse is installed by npm at the version
below, once; the participant's cookie goes along as a header, and a run counts only if it ended on the page that was
asked for. It takes about five minutes. Other work on the machine shows in Lighthouse's performance, and in the time to
a view, most of which is the wait until the action is on disk and the next frame is due.
"""

import json
import os
import random
import runpy
import shutil
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, sync_playwright

from tests.browser.arrivals import agree_until
from tests.browser.page_costs import PageCost, weigh
from tests.browser.site import Site, serve
from tests.browser.walker import DRIVES, GIVE_UP, Walker
from tests.browser.windows import PHONE
from tests.conftest import ROOT
from webapp.stimuli.agents import planner_agents
from webapp.stimuli.build import build

STUDY = "understanding"
KIND = "tailored_all"  # It has the most pictures.
LIGHTHOUSE = "12.8.2"  # The last that runs with node 20.
FOLDER = ROOT / ".pytest_cache" / f"lighthouse-{LIGHTHOUSE}"
NUM_RUNS = 5
# Now and then, on a busy machine, Chromium's trace lacks its beginning, and Lighthouse asks to be run again.
NUM_TRIES = 3
NUM_PRESSES = 24
KILOBYTE = 1000
RATED = {"performance": 98.0, "accessibility": 100.0, "best-practices": 100.0}
FORMS: dict[str, list[str]] = {"phone": [], "desktop": ["--preset=desktop"]}

# Notes the milliseconds from each click until the frame with the new view is drawn, which is what Chromium's Element
# Timing says too, but that tells only of pictures that it has not told of lately.
_TIME_VIEWS = """() => {
    const view = document.querySelector("[data-view]");
    window.waits = [];
    let pressedAt = null;
    document.addEventListener("click", (event) => { pressedAt = event.timeStamp; }, true);
    new MutationObserver(async () => {
        await view.decode();
        requestAnimationFrame(() => {
            const { port1, port2 } = new MessageChannel();
            port1.onmessage = () => window.waits.push(performance.now() - pressedAt);
            port2.postMessage("drawn");
        });
    }).observe(view, { attributeFilter: ["src"] });
}"""


class Unmeasured(Exception):
    """Something that measuring needs is missing; the message says what."""


@dataclass(frozen=True, slots=True)
class Line:
    """One measured number and its limit."""

    name: str
    measured: float
    unit: str
    limit: float
    at_least: bool = False

    @property
    def kept(self) -> bool:
        """Whether the promise is."""
        return self.measured >= self.limit if self.at_least else self.measured <= self.limit

    def __str__(self) -> str:
        promised = f"promised {'at least' if self.at_least else 'at most':8} {self.limit:4.0f}"
        return f"{self.name:46} {self.measured:7.1f} {self.unit:6} {promised}   {'kept' if self.kept else 'BROKEN'}"


def main() -> int:
    """Print measured and promised numbers, one line each, and return 0 if all promises are kept."""
    try:
        lines = list(_lines())
    except Unmeasured as problem:
        print(f"pages: {problem}")
        return 1
    return 0 if all(line.kept for line in lines) else 1


def _lines() -> Iterator[Line]:
    """Serve the study and print each line as it comes."""
    chromium, lighthouse = find_chromium(), install_lighthouse()
    with tempfile.TemporaryDirectory() as scratch, sync_playwright() as playwright:
        built, instance = Path(scratch, "built"), Path(scratch, "instance")
        instance.mkdir()
        build(ROOT / "webapp/studies" / STUDY, built, lambda *_: None, agents=planner_agents)
        browser = playwright.chromium.launch(executable_path=chromium, args=sandbox())
        with serve(built, instance, STUDY) as site:
            for line in measure(browser, site, Lighthouse(lighthouse, chromium, Path(scratch, "report.json"))):
                print(line, flush=True)
                yield line
        browser.close()


def find_chromium() -> str:
    """Return the path of the Chromium that the browser tests use."""
    path: str | None = runpy.run_path(str(ROOT / ".ci/install.py"))["find_browser"]()
    if path is None:
        raise Unmeasured("no Chromium was found; `make test` installs one or says how")
    return path


def install_lighthouse() -> Path:
    """Return the path of the pinned Lighthouse, installed by npm if this is the first time."""
    program = FOLDER / "node_modules/.bin/lighthouse"
    npm = shutil.which("npm")
    if shutil.which("node") is None or npm is None:
        raise Unmeasured("Lighthouse needs node (18.16 or later) with npm on the path, and there is none")
    if not program.exists():
        FOLDER.mkdir(parents=True, exist_ok=True)
        wanted = ["--no-save", "--no-audit", "--no-fund", "--prefix", str(FOLDER), f"lighthouse@{LIGHTHOUSE}"]
        finished = subprocess.run([npm, "install", *wanted], check=False, capture_output=True, text=True)
        if finished.returncode != 0:
            raise Unmeasured(f"npm cannot install Lighthouse: {' '.join(finished.stderr.split())}")
    return program


def sandbox() -> list[str]:
    """Return what Chromium has to be told where it runs as root."""
    return ["--no-sandbox"] if os.geteuid() == 0 else []


@dataclass(frozen=True, slots=True)
class Lighthouse:
    """Rates pages.

    Attributes:
        program: Its path.
        chromium: The browser's path.
        report: Where a report may be written.
    """

    program: Path
    chromium: str
    report: Path

    def rate(self, name: str, walker: Walker) -> Iterator[Line]:
        """Rate the page that somebody is at as often as asked for, as on a phone and on a desktop."""
        for form, options in FORMS.items():
            runs = [self._run(walker, options) for _ in range(NUM_RUNS)]
            for category, limit in RATED.items():
                scores = [100 * run["categories"][category]["score"] for run in runs]
                score = statistics.median(scores) if category == "performance" else min(scores)
                yield Line(f"{name}, {form}: Lighthouse {category}", score, "", limit, at_least=True)

    def _run(self, walker: Walker, options: list[str]) -> dict[str, Any]:
        cookies = "; ".join(f"{cookie['name']}={cookie['value']}" for cookie in walker.page.context.cookies())
        command = [
            str(self.program),
            walker.page.url,
            f"--only-categories={','.join(RATED)}",
            f"--chrome-flags={' '.join(['--headless=new', *sandbox()])}",
            f"--extra-headers={json.dumps({'Cookie': cookies} if cookies else {})}",
            "--output=json",
            f"--output-path={self.report}",
            "--quiet",
            "--no-enable-error-reporting",
            *options,
        ]
        environment = {**os.environ, "CHROME_PATH": self.chromium}
        for _ in range(NUM_TRIES):
            finished = subprocess.run(command, check=False, env=environment, capture_output=True, text=True)
            if finished.returncode == 0:
                break
        else:
            raise Unmeasured(f"Lighthouse could not rate {walker.page.url}: {finished.stderr.strip()}")
        run: dict[str, Any] = json.loads(self.report.read_text(encoding="utf-8"))
        assert run["finalDisplayedUrl"] == walker.page.url, f"{walker.page.url} led to {run['finalDisplayedUrl']}"
        assert "runtimeError" not in run, run["runtimeError"]
        return run


def measure(browser: Browser, site: Site, lighthouse: Lighthouse) -> Iterator[Line]:
    """Go to the three pages, yielding what each costs and how it is rated, and what an action of the drive takes."""
    context = browser.new_context(base_url=site.address, **PHONE)
    walker = Walker(context.new_page(), site.catalogue, "", random.Random(1))
    walker.page.goto("/")
    yield from _costs("welcome", weigh(browser, walker.page, PHONE))
    yield from lighthouse.rate("welcome", walker)
    agree_until(walker, site, lambda kinds: kinds[0] == KIND)
    go_to("situation", walker)
    situation = weigh(browser, walker.page, PHONE)
    go_to("rating", walker)
    trial = weigh(browser, walker.page, PHONE)
    yield from _costs("trial", trial)
    pictures = (situation.picture_bytes + trial.picture_bytes) / KILOBYTE
    yield Line("trial: pictures, those of the situation included", pictures, "KB", 150)
    yield from lighthouse.rate("trial", walker)
    go_to("drive", walker)
    yield from _costs("drive", weigh(browser, walker.page, PHONE))
    yield from lighthouse.rate("drive", walker)
    yield Line("drive: from a press to the view, median", statistics.median(waits(walker)), "ms", 50)
    context.close()


def go_to(kind: str, walker: Walker) -> None:
    """Answer pages, not caring to arrive anywhere in the drives, until one of a kind is in front."""
    while walker.kind() != kind:
        if walker.kind() in DRIVES:
            walker.drive("left", GIVE_UP)
        else:
            walker.answer_page()


def waits(walker: Walker) -> list[float]:
    """Press buttons of the drive in front; return the milliseconds until each view was painted."""
    walker.page.locator("form[data-clock=running]").wait_for()
    walker.page.evaluate(_TIME_VIEWS)
    found: list[float] = []
    for number in range(1, NUM_PRESSES + 1):
        walker.act(walker.rng.choice(("forward", "left", "right")))
        while len(found) < number:
            found = walker.page.evaluate("window.waits")
    return found


def _costs(name: str, cost: PageCost) -> Iterator[Line]:
    yield Line(f"{name}: besides pictures", cost.page_bytes / KILOBYTE, "KB", 60)
    yield Line(f"{name}: requests to other hosts", len(cost.foreign), "", 0)
    yield Line(f"{name}: cumulative layout shift", cost.layout_shift, "", 0)


if __name__ == "__main__":
    sys.exit(main())
