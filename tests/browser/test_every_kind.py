"""Every kind of explanation, on both sizes, in both languages, with scripts and without: two runs for each kind.

Any two values of kind, size, language and scripts meet in some run; `make soak` goes through all combinations.
"""

import itertools
import random
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import pytest
from playwright.sync_api import Browser

from tests.browser.arms import has_satisfaction, layout_of, serve_arm
from tests.browser.site import Row, Site
from tests.browser.walker import GIVE_UP, Walker
from tests.browser.windows import DESKTOP, PHONE, TIMEOUT_MS, watch
from webapp.storage.exports import FileName
from webapp.study.experiments import BUILT_IN_KINDS, SATISFACTION_ITEMS, TAILORED_KINDS, Kind
from webapp.study.session import Trial

KINDS: tuple[Kind, ...] = BUILT_IN_KINDS
FILES: tuple[FileName, ...] = (
    "participants.csv",
    "ratings.csv",
    "answers.csv",
    "probes.csv",
    "drives.csv",
    "events.csv",
)


@dataclass(frozen=True, slots=True)
class Way:
    """How somebody takes part."""

    phone: bool
    language: str
    scripts: bool


ALL_WAYS = tuple(Way(*values) for values in itertools.product((False, True), ("en", "ja"), (True, False)))


def two_ways(number: int) -> tuple[Way, Way]:
    """Two ways that differ in everything, others for the next kind."""
    one = ALL_WAYS[(0, 1, 2, 3)[number % 4]]
    return one, Way(not one.phone, "ja" if one.language == "en" else "en", not one.scripts)


RUNS = [(kind, way) for number, kind in enumerate(KINDS) for way in two_ways(number)]


@dataclass(frozen=True, slots=True)
class Run:
    """What one participant did, and the files afterwards."""

    way: Way
    walker: Walker
    files: Mapping[FileName, list[Row]]


def take_part(browser: Browser, site: Site, kind: Kind, way: Way, seed: int) -> Run:
    """Go through the study of a kind; nothing may complain."""
    complaints: list[str] = []
    size: dict[str, Any] = PHONE if way.phone else DESKTOP
    context = browser.new_context(
        base_url=site.address, reduced_motion="reduce", java_script_enabled=way.scripts, **size
    )
    context.set_default_timeout(TIMEOUT_MS)
    watch(context, complaints, ())
    step = site.catalogue.from_step(trial_of(kind))
    first = ("left", GIVE_UP)
    walker = Walker(context.new_page(), site.catalogue, layout_of(kind), random.Random(seed), way.language, step, first)
    walker.waits = way.scripts
    walker.complete()
    assert walker.page.url.endswith("/done")
    context.close()
    assert complaints == []
    newest = max(site.export("participants.csv"), key=lambda row: row["consented_at"])["participant"]
    files = {name: [row for row in site.export(name) if row["participant"] == newest] for name in FILES}
    return Run(way, walker, files)


def trial_of(kind: Kind) -> Trial:
    return Trial("1", 1, 1, layout_of(kind), kind, 0 if kind == "random" else None)


@pytest.fixture(scope="module", params=KINDS)
def runs(
    request: pytest.FixtureRequest, browser: Browser, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[Kind, Site, list[Run]]]:
    """Two participants of the study of one kind."""
    kind: Kind = request.param
    with serve_arm(tmp_path_factory.mktemp(kind), kind) as site:
        ways = two_ways(KINDS.index(kind))
        yield kind, site, [take_part(browser, site, kind, way, seed) for seed, way in enumerate(ways)]


def test_any_two_choices_meet_in_some_run() -> None:
    assert len(RUNS) == 24
    for one, other in itertools.combinations(("kind", "phone", "language", "scripts"), 2):
        values = [{"kind": kind, "phone": w.phone, "language": w.language, "scripts": w.scripts} for kind, w in RUNS]
        possible = itertools.product({v[one] for v in values}, {v[other] for v in values})
        assert {(v[one], v[other]) for v in values} == set(possible)


def test_every_file_holds_exactly_what_was_done(runs: tuple[Kind, Site, list[Run]]) -> None:
    kind, site, people = runs
    for run in people:
        assert_files(kind, site, run)


def assert_files(kind: Kind, site: Site, run: Run) -> None:
    assert_pages(kind, run)
    assert_participant(run)
    assert_ratings(kind, run)
    assert_explanation(kind, site, run)
    assert_predictions(site, run)
    assert_drives(kind, site, run)
    assert_events(run)


def assert_pages(kind: Kind, run: Run) -> None:
    seen = run.walker.seen
    assert seen[:4] == ["background", "instructions", "practice", "quiz"]
    assert ("first_drive" in seen) == (kind in TAILORED_KINDS)
    assert ("satisfaction" in seen) == has_satisfaction(kind)
    assert seen.index("probe") < seen.index("drive")
    is_rated_last = len(kind) % 2 == 1
    assert (seen.index("drive") < seen.index("rating")) == is_rated_last


def assert_participant(run: Run) -> None:
    (person,) = run.files["participants.csv"]
    assert (person["language"], person["guardian_agreed"]) == (run.way.language, "false")
    assert person["translation"] == ("original" if run.way.language == "en" else "unvalidated")
    assert person["completed_at"]
    answers = {(row["purpose"], row["question"]): row for row in run.files["answers.csv"]}
    assert answers["quiz", "goal"]["is_correct"] == "true"
    assert answers["background", "age"]["answer"] == "33"


def assert_ratings(kind: Kind, run: Run) -> None:
    rows = {row["item"]: int(row["rating"]) for row in run.files["ratings.csv"]}
    chosen = {item: value for item, value in run.walker.ratings.items() if not item.startswith("confidence-")}
    assert rows == chosen
    asked = {"likeliness"} if kind == "none" else {"likeliness", "general"}
    assert set(rows) == asked | (set(SATISFACTION_ITEMS) if has_satisfaction(kind) else set())
    for row in run.files["ratings.csv"]:
        assert (row["kind"], bool(row["response_time_ms"])) == (kind, run.way.scripts)


def assert_explanation(kind: Kind, site: Site, run: Run) -> None:
    if kind == "none":
        assert run.walker.shown == []
        return
    (row, *_) = run.files["ratings.csv"]
    key_points = None
    if kind in TAILORED_KINDS:
        drive = next(row for row in run.files["drives.csv"] if row["phase"] == "before")
        key_points = [int(step) for step in drive["key_points"].split()]
        assert key_points
    trial = Trial("1", 1, 1, row["layout"], kind, int(row["draw"]) if row["draw"] else None)
    strips = site.catalogue.explanation(trial, run.way.language, key_points)
    assert run.walker.shown == [frame.digest for strip in strips for frame in strip.frames]


def assert_predictions(site: Site, run: Run) -> None:
    (row,) = run.files["probes.csv"]
    (asked,) = site.catalogue.probes("1", row["layout"])
    predicted = run.walker.predictions["predict-1"]
    assert (row["predicted"], row["action"], row["state"]) == (predicted, asked.action, str(asked.state))
    assert row["is_correct"] == ("true" if predicted == asked.action else "false")
    assert int(row["confidence"]) == run.walker.ratings["confidence-1"]
    assert bool(row["response_time_ms"]) == run.way.scripts


def assert_drives(kind: Kind, site: Site, run: Run) -> None:
    drives = {row["phase"]: row for row in run.files["drives.csv"]}
    assert set(drives) == {"practice", "after", *(["before"] if kind in TAILORED_KINDS else [])}
    world = site.catalogue.world(layout_of(kind))
    way = world.path_actions[run.walker.from_step - 1 :]
    after = drives["after"]
    assert (after["end"], after["actions"].split()) == ("reached", list(way))
    assert (int(after["num_steps"]), int(after["optimum"])) == (len(way), len(way))
    assert (drives["practice"]["end"], drives["practice"]["kind"]) == ("gave_up", "")
    if "before" in drives:
        assert (drives["before"]["end"], drives["before"]["actions"]) == ("gave_up", "left")


def assert_events(run: Run) -> None:
    names = {row["event"] for row in run.files["events.csv"]}
    assert "drive_action" in names
    assert {"painted", "changed"} <= names if run.way.scripts else names == {"drive_action"}
    if run.way.scripts:
        assert "visible" in names
    actions = [row for row in run.files["events.csv"] if row["event"] == "drive_action"]
    assert all(bool(row["at_ms"]) == run.way.scripts for row in actions)
    assert all(row["received_at"] for row in run.files["events.csv"])
