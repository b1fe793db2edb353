"""Six participants go through both experiments; then the researcher's files are compared with what they clicked."""

import itertools
import random
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.browser.participant import Answered, Hand, Participant
from tests.browser.researcher import download, sign_in, unblind
from tests.browser.site import Row, Site, read_csv, serve
from tests.browser.windows import DESKTOP, PHONE, OpenContext
from webapp.study.session import Trial


@dataclass(frozen=True, slots=True)
class Way:
    """How somebody takes part: every two of the three ways to differ meet in some run."""

    scripts: bool
    phone: bool
    hand: Hand


# Two in a row get the two arrangements of Experiment 2, so that each is seen with scripts and without.
WAYS = (
    Way(scripts=True, phone=False, hand="mouse"),
    Way(scripts=True, phone=True, hand="touch"),
    Way(scripts=False, phone=False, hand="keyboard"),
    Way(scripts=False, phone=True, hand="touch"),
    Way(scripts=True, phone=False, hand="keyboard"),
    Way(scripts=False, phone=True, hand="keyboard"),
)


@dataclass(frozen=True, slots=True)
class Outcome:
    """What the six answered, and the two files."""

    answers: list[list[Answered]]
    ratings: list[Row]
    participants: list[Row]


@pytest.fixture(scope="module")
def site(built_instance: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    """What people are shown: the explanations of the agents that have learned."""
    with serve(built_instance, tmp_path_factory.mktemp("instance")) as site:
        yield site


@pytest.fixture(scope="module")
def outcome(site: Site, open_context: OpenContext, tmp_path_factory: pytest.TempPathFactory) -> Outcome:
    answers = []
    for number, way in enumerate(WAYS):
        context = open_context(java_script_enabled=way.scripts, **(PHONE if way.phone else DESKTOP))
        participant = Participant(context.new_page(), site, random.Random(number), way.hand, waits=way.scripts)
        participant.complete()
        context.pages[0].close()
        answers.append(participant.answers)
    page = open_context(accept_downloads=True).new_page()
    sign_in(page, site)
    unblind(page, site)
    folder: Path = tmp_path_factory.mktemp("downloads")
    return Outcome(answers, download(page, "ratings.csv", folder), download(page, "participants.csv", folder))


def rows_of(outcome: Outcome, number: int) -> list[Row]:
    in_order = sorted(outcome.participants, key=lambda row: row["consented_at"])
    return [row for row in outcome.ratings if row["participant"] == in_order[number]["participant"]]


@pytest.mark.parametrize("number", range(len(WAYS)))
def test_the_file_holds_exactly_what_was_clicked(outcome: Outcome, number: int) -> None:
    clicked = {
        (page.experiment, str(page.position), item): str(rating)
        for page in outcome.answers[number]
        for item, rating in page.ratings.items()
    }
    rows = rows_of(outcome, number)
    assert {(row["experiment"], row["trial"], row["item"]): row["rating"] for row in rows} == clicked
    assert len(rows) == len(clicked) == 15


@pytest.mark.parametrize("number", range(len(WAYS)))
def test_the_kind_and_draw_on_file_are_what_was_shown(outcome: Outcome, number: int, site: Site) -> None:
    for page in outcome.answers[number]:
        row = next(
            row
            for row in rows_of(outcome, number)
            if (row["experiment"], row["trial"]) == (page.experiment, str(page.position))
        )
        strips = site.catalogue.explanation(_trial(row, site), "en")
        assert page.strips == tuple(tuple(frame.digest for frame in strip.frames) for strip in strips)
        assert page.alts == tuple(tuple(frame.alt for frame in strip.frames) for strip in strips)
        assert page.actions == tuple(strip.actions for strip in strips)


@pytest.mark.parametrize("number", range(len(WAYS)))
def test_response_times_are_there_with_scripts_and_only_then(outcome: Outcome, number: int) -> None:
    for row in rows_of(outcome, number):
        page = next(
            page
            for page in outcome.answers[number]
            if (page.experiment, str(page.position)) == (row["experiment"], row["trial"])
        )
        if WAYS[number].scripts:
            assert 0 < int(row["response_time_ms"]) <= 1000 * page.seconds
        else:
            assert row["response_time_ms"] == ""


def test_every_assignment_of_both_experiments_was_used_equally_often(outcome: Outcome, site: Site) -> None:
    for experiment in site.catalogue.study.experiments:
        used = [_kinds(rows_of(outcome, number), experiment.id) for number in range(len(WAYS))]
        possible = sorted(itertools.permutations(experiment.kinds))
        assert sorted(used) == sorted(possible * (len(WAYS) // len(possible)))


def test_every_row_names_the_study_its_version_and_the_test_run(outcome: Outcome, site: Site) -> None:
    for row in outcome.ratings + outcome.participants:
        assert (row["study"], row["study_version"], row["mode"]) == ("sakai2021", site.catalogue.version, "test")


def test_everybody_has_completed(outcome: Outcome) -> None:
    assert len(outcome.participants) == len(WAYS)
    for row in outcome.participants:
        assert row["completed_at"]
        assert row["withdrawn_at"] == ""


def test_the_command_line_exports_the_same_rows(outcome: Outcome, site: Site, tmp_path: Path) -> None:
    site.export_by_command(tmp_path / "data")
    assert read_csv((tmp_path / "data/data/description-ratings_data.csv").read_bytes()) == outcome.ratings
    assert read_csv((tmp_path / "data/data/description-participants_data.csv").read_bytes()) == outcome.participants


def _trial(row: Row, site: Site) -> Trial:
    num_trials = len(site.catalogue.study.experiment(row["experiment"]).layouts)
    draw = int(row["draw"]) if row["draw"] else None
    return Trial(row["experiment"], int(row["trial"]), num_trials, row["layout"], row["kind"], draw)


def _kinds(rows: list[Row], experiment: str) -> tuple[str, ...]:
    by_trial = {int(row["trial"]): row["kind"] for row in rows if row["experiment"] == experiment}
    return tuple(by_trial[position] for position in sorted(by_trial))
