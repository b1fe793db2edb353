"""Bots on the real server: `xar bots`, and the parts of it where something has to go wrong."""

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from tests.web.bundles import FILLED_IN, read_study, write_bundle
from tests.web.reading import ask, num_rows, place
from tests.web.servers import run as run_xar
from tests.web.servers import serving
from tests.web.studies import BACKGROUND, CHECKS, PROLIFIC, QUIZ, a_study, one_experiment
from webapp.bots.behaviours import BEHAVIOURS
from webapp.bots.browser import Site
from webapp.bots.effects import Effects
from webapp.bots.errors import NotLetInAsBotError
from webapp.bots.ledger import Ledger
from webapp.bots.plan import make_plan
from webapp.bots.reckoning import reckon
from webapp.bots.running import run
from webapp.bots.walk import Surroundings
from webapp.stimuli.catalogue import Catalogue, current_bundle
from webapp.storage.database import open_database
from webapp.storage.instance import secret_key
from webapp.study.protocol import Study
from webapp.views.tokens import bot_pass

EVERY_BEHAVIOUR = ",".join(f"{name}=1" for name in BEHAVIOURS)
NUM_BOTS = 12


def everything() -> Study:
    """A study with every kind of page, whose participants a recruiter sends."""
    return a_study(
        **FILLED_IN,
        consent={"minimum_age": 12, "guardian_below": 18},
        background=BACKGROUND,
        practice={"layout": "simulation", "steps_per_optimal_step": 1.5},
        quiz=QUIZ,
        attention_checks=CHECKS,
        recruitment=PROLIFIC,
        behaviour_log={},
        experiments=one_experiment(
            ["tailored_all", "placebic", "none"],
            drive={"when": "before_ratings", "baseline": True, "steps_per_optimal_step": 1.5},
            probe={"num_questions": 2},
            satisfaction=True,
        ),
    )


def bots(instance: Path, *words: str, status: int = 0) -> Mapping[str, Any]:
    """Run `xar bots --json` and return what it printed."""
    done = run_xar(instance, "bots", "--json", *words)
    assert done.returncode == status, done.stderr
    printed: Mapping[str, Any] = json.loads(done.stdout)
    return printed


@pytest.fixture
def instance(tmp_path: Path) -> Path:
    return tmp_path / "instance"


@pytest.mark.parametrize("study", [read_study, everything], ids=["the paper's", "everything"])
def test_what_every_behaviour_sends_is_stored_once_and_as_of_bots(instance: Path, study: Callable[[], Study]) -> None:
    write_bundle(instance, study())
    told = bots(instance, "--participants", str(NUM_BOTS), "--mix", EVERY_BEHAVIOUR, "--workers", "6")
    assert (told["lost"], told["doubled"], told["stuck"]) == ([], [], [])
    assert list(told["behaviours"]) == list(BEHAVIOURS)
    assert sum(counts["started"] for counts in told["behaviours"].values()) == NUM_BOTS
    assert ask(instance, "SELECT DISTINCT mode FROM participants") == [("bot",)]
    assert num_rows(instance, "participants") == NUM_BOTS
    assert num_rows(instance, "pages") == told["acknowledged_pages"]
    dropped = told["behaviours"].pop("drop-out")
    assert dropped["withdrew"] + dropped["vanished"] == dropped["started"]
    assert all(counts["completed"] == counts["started"] for counts in told["behaviours"].values())


RATINGS = """
    SELECT DISTINCT t.kind, item = 'general', rating FROM ratings r
    JOIN pages p ON p.participant_id = r.participant_id AND p.number = r.page_number
    JOIN trials t ON t.participant_id = p.participant_id AND t.number = p.trial_number WHERE t.kind != 'tailored_all'
"""
PREDICTIONS = """
    SELECT DISTINCT t.kind, is_correct FROM predictions r
    JOIN pages p ON p.participant_id = r.participant_id AND p.number = r.page_number
    JOIN trials t ON t.participant_id = p.participant_id AND t.number = p.trial_number WHERE t.kind != 'tailored_all'
"""
DRIVES = """
    SELECT DISTINCT t.kind, "end" FROM drives r
    JOIN pages p ON p.participant_id = r.participant_id AND p.number = r.page_number
    JOIN trials t ON t.participant_id = p.participant_id AND t.number = p.trial_number
    WHERE t.kind != 'tailored_all' AND phase = 'after'
"""


def test_declared_effects_are_in_the_data(instance: Path) -> None:
    write_bundle(instance, everything())
    effects = ("none=-9", "placebic=9", "placebic.general=-9", "placebic.probe=1", "none.probe=-1")
    drives = ("placebic.drive=1", "none.drive=-1")
    words = [word for effect in (*effects, *drives) for word in ("--effect", effect)]
    bots(instance, "--participants", "6", "--mix", "attentive=1", "--language", "ja", *words)
    assert set(ask(instance, RATINGS)) == {("none", 0, 1), ("placebic", 0, 5), ("placebic", 1, 1)}
    assert set(ask(instance, PREDICTIONS)) == {("none", 0), ("placebic", 1)}
    assert set(ask(instance, DRIVES)) == {("none", "gave_up"), ("placebic", "reached")}
    assert set(ask(instance, "SELECT DISTINCT language FROM participants")) == {("ja",)}
    assert num_rows(instance, "recruits") == 6


def test_bots_use_the_server_that_runs_and_are_no_data_where_it_is_live(instance: Path) -> None:
    write_bundle(instance, read_study(**FILLED_IN))
    with serving(instance, "--live"):
        told = bots(instance, "--participants", "2", "--mix", "attentive=1")
    assert told["behaviours"]["attentive"]["completed"] == 2
    assert ask(instance, "SELECT mode, count(*) FROM participants GROUP BY mode") == [("bot", 2)]


def test_who_has_no_time_left_is_told_of_with_exit_status_1(instance: Path) -> None:
    write_bundle(instance, read_study())
    words = ("--participants", "2", "--mix", "attentive=1", "--pace", "10", "--time-limit", "1")
    told = bots(instance, *words, status=1)
    assert told["behaviours"]["attentive"]["out_of_time"] == 2
    assert told["stuck"] == ["bot 1: its time was over", "bot 2: its time was over"]
    assert (told["lost"], told["doubled"]) == ([], [])


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--mix", "attentiv=1"), "xar: --mix names 'attentiv'; did you mean 'attentive'?\n"),
        (("--effect", "subgoal=1"), "xar: --effect names the kind 'subgoal'; did you mean 'subgoals'?\n"),
        (("--language", "tlh"), "xar: --language is 'tlh'; the study has en, ja\n"),
        (("--study", "another"), "there is no bundle of study 'another'"),
    ],
)
def test_a_mistake_is_one_line_and_nobody_takes_part(instance: Path, words: tuple[str, ...], said: str) -> None:
    write_bundle(instance, read_study())
    done = run_xar(instance, "bots", *words)
    assert (done.returncode, done.stdout) == (2, "")
    assert said in done.stderr
    assert not (instance / "xar.sqlite3").exists()


@contextmanager
def surroundings(instance: Path) -> Iterator[Surroundings]:
    """What bots need who are run by hand, on a server in a process of its own."""
    write_bundle(instance, read_study())
    catalogue = Catalogue.open(current_bundle(instance, "sakai2021"))
    with serving(instance) as server, open_database(place(instance), make=False) as database:
        yield Surroundings(
            site=Site("127.0.0.1", server.port, f"127.0.0.1:{server.port}"),
            database=database,
            study="sakai2021",
            recruitment=None,
            version=lambda _version: catalogue,
            bot_pass=bot_pass(secret_key(instance)),
            effects=Effects(),
        )


def test_if_the_server_takes_the_first_bot_for_a_person_no_other_follows(instance: Path) -> None:
    with surroundings(instance) as around:
        stranger = replace(around, bot_pass=bot_pass(b"another secret"))
        with pytest.raises(NotLetInAsBotError, match="let a bot in as 'test'"):
            run(make_plan({"attentive": 1}, 20, ("en",), 0), stranger, num_workers=8, limit_s=30)
    assert ask(instance, "SELECT mode, count(*) FROM participants GROUP BY mode") == [("test", 1)]


def test_another_study_than_the_one_asked_for_is_refused(instance: Path) -> None:
    with surroundings(instance) as around, pytest.raises(NotLetInAsBotError, match="use --study sakai2021"):
        run(make_plan({"attentive": 1}, 1, ("en",), 0), replace(around, study="other"), num_workers=1, limit_s=30)


def test_a_row_that_is_missing_changed_or_too_many_is_found(instance: Path) -> None:
    with surroundings(instance) as around:
        reports = run(make_plan({"attentive": 1}, 1, ("en",), 0), around, num_workers=1, limit_s=30)
        (report,) = reports
        assert report.participant is not None
        code, sent = report.participant.code, report.ledger.acknowledged
        good = reckon(reports, around.database)
        assert (good.lost, good.doubled, good.num_pages) == ((), (), len(sent))
        changed = dict(sent) | {3: [(*e[:2], "9", *e[3:]) if e[1:2] == ("general",) else e for e in sent[3]]}
        slower = dict(sent) | {3: [(*e[:3], "7") if e[1:2] == ("general",) else e for e in sent[3]]}
        never_sent = {number: entries for number, entries in sent.items() if number != 4}
        beyond = dict(sent) | {12: [("page",)]}
        under_way = Ledger(never_sent, {4: sent[4]})
        ledgers = (Ledger(changed), Ledger(never_sent), Ledger(beyond), under_way, Ledger(slower))
        found = [reckon([replace(report, ledger=ledger)], around.database) for ledger in ledgers]
    (rated,) = (entry for entry in sent[3] if entry[1:2] == ("general",))
    assert found[0].lost == (f"{code}, page 3: rating general 9 {rated[3]}",)
    assert found[0].doubled[0].startswith(f"{code}, page 3: rating general ")
    assert (found[1].lost, found[1].doubled) == ((), (f"{code}, page 4: page",))
    assert (found[2].lost, found[2].doubled) == ((f"{code}, page 12: page",), ())
    # A time that was not stored as it was sent is a row that was not.
    assert found[4].lost == (f"{code}, page 3: rating general {rated[2]} 7",)
    assert found[4].doubled == (f"{code}, page 3: {' '.join(rated)}",)
    # What was still under way may be stored or not.
    assert (found[3].lost, found[3].doubled) == ((), ())
