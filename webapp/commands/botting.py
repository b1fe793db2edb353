"""`xar bots`: programs take part in a study, and what is stored of them is compared with what they sent."""

import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from webapp.command_line import CommandError, refusals, show, show_json

if TYPE_CHECKING:
    from rich.console import RenderableType

    from webapp.bots.reckoning import Reckoning
    from webapp.bots.running import Report
    from webapp.config import Config
    from webapp.stimuli.catalogue import Catalogue

_DEFAULT_MIX = "attentive=6,straight-liner=1,random=1,drop-out=1,double-clicker=1"
_LISTED = 20
"""How many lost or doubled rows are printed one by one."""


@click.command()
@click.option("--participants", type=click.IntRange(1, 100_000), default=12, metavar="N", help="How many bots.")
@click.option(
    "--mix",
    default=_DEFAULT_MIX,
    metavar="NAME=SHARE,...",
    help="Shares of attentive, straight-liner, random, acquiescent, fast, drop-out, double-clicker and refresher.",
)
@click.option(
    "--effect",
    "effects",
    multiple=True,
    metavar="KIND[.ITEM]=DELTA",
    help="Plant an effect: on all ratings of a kind, on one item, on its probe or on its drive; may be repeated.",
)
@click.option("--study", help="The study to take part in (XAR_STUDY).")
@click.option(
    "--language",
    "languages",
    multiple=True,
    metavar="CODE",
    help="What they read; several are taken in turn, the study's first if not given.",
)
@click.option(
    "--seed", type=click.IntRange(min=0), default=0, metavar="S", help="Decides who does what, and on every answer."
)
@click.option("--workers", type=click.IntRange(1, 64), default=4, metavar="N", help="How many take part at a time.")
@click.option(
    "--pace",
    type=click.FloatRange(0, 10),
    default=0.0,
    metavar="X",
    help="Wait as people would: 1 for as long, 0 for not at all.",
)
@click.option(
    "--time-limit", type=click.FloatRange(1, 86_400), default=600.0, metavar="S", help="Seconds that each bot has."
)
@click.option("--json", "prints_json", is_flag=True, help="Print one JSON object instead of tables.")
def bots(study: str | None, mix: str, *, prints_json: bool, **choices: Any) -> None:  # noqa: ANN401 - handed on.
    """Let programs take part, drives included, and make sure that all their answers are stored, once.

    Their rows have the mode `bot`: they count towards no balance and no result. They use the server that runs on this
    instance, or else run one of their own. The exit status is 1 if anything was lost or doubled or a bot got stuck.
    """
    from webapp.bots.errors import BotError, NotLetInAsBotError
    from webapp.config import read_config

    try:
        with refusals():
            outcome = _let_them_take_part(read_config(os.environ, study=study), mix, **choices)
    except (BotError, NotLetInAsBotError) as error:
        raise CommandError(str(error)) from error
    if prints_json:
        show_json(_as_json(outcome))
    else:
        show(*_tables(outcome))
    if not outcome.is_well:
        raise click.exceptions.Exit(1)


@dataclass(frozen=True, slots=True)
class _Outcome:
    study: str
    seed: int
    reports: "Sequence[Report]"
    reckoning: "Reckoning"

    @property
    def study_versions(self) -> list[str]:
        """The versions that were shown, which is one unless the server was started anew meanwhile."""
        return sorted({report.participant.study_version for report in self.reports if report.participant})

    @property
    def stuck(self) -> "list[Report]":
        """Those that got stuck."""
        return [report for report in self.reports if report.reason]

    @property
    def is_well(self) -> bool:
        """Whether everything acknowledged is stored once and nobody got stuck."""
        return not (self.stuck or self.reckoning.lost or self.reckoning.doubled)


def _let_them_take_part(  # noqa: PLR0913 - the options of the verb.
    config: "Config",
    mix: str,
    *,
    participants: int,
    effects: Sequence[str],
    languages: Sequence[str],
    seed: int,
    workers: int,
    pace: float,
    time_limit: float,
) -> _Outcome:
    from webapp.bots.effects import parse_effects
    from webapp.bots.mix import parse_mix
    from webapp.bots.plan import make_plan
    from webapp.bots.reckoning import reckon
    from webapp.bots.running import run
    from webapp.bots.server import a_server
    from webapp.bots.surroundings import surroundings_on
    from webapp.stimuli.catalogue import Catalogue, current_bundle
    from webapp.storage.database import open_database

    shares = parse_mix(mix)
    catalogue = Catalogue.open(current_bundle(config.instance, config.study))
    planted = parse_effects(effects, catalogue.study)
    plans = make_plan(shares, participants, _languages(languages, catalogue), seed)
    with a_server(config) as site, open_database(config, make=False) as database:
        around = surroundings_on(site, database, config, catalogue, planted, pace)
        with _progress(participants) as advance:
            reports = run(plans, around, num_workers=workers, limit_s=time_limit, on_end=lambda _report: advance())
        return _Outcome(config.study, seed, reports, reckon(reports, database))


@contextmanager
def _progress(num_bots: int) -> Iterator[Callable[[], None]]:
    """Show on a terminal how many bots are done."""
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True, disable=not sys.stderr.isatty()) as progress:
        task = progress.add_task("Bots", total=num_bots)
        yield lambda: progress.advance(task)


def _languages(wished: Sequence[str], catalogue: "Catalogue") -> Sequence[str]:
    declared = catalogue.study.languages
    for language in wished:
        if language not in declared:
            raise CommandError(f"--language is {language!r}; the study has {', '.join(declared)}")
    return wished or declared[:1]


_ENDINGS = ("completed", "withdrew", "vanished", "screened_out", "turned_away", "out_of_time", "failed")
_COLUMNS = {
    "started": "Started",
    "completed": "Completed",
    "withdrew": "Withdrew",
    "vanished": "Vanished",
    "screened_out": "Screened out",
    "turned_away": "Turned away",
    "out_of_time": "Out of time",
    "failed": "Got stuck",
    "acknowledged_pages": "Pages",
}
_ALWAYS = {"started", "completed", "withdrew", "vanished", "acknowledged_pages"}
"""The columns that are printed even where nothing but zeros stands in them."""


def _as_json(outcome: _Outcome) -> Mapping[str, object]:
    return {
        "study": outcome.study,
        "study_versions": outcome.study_versions,
        "mode": "bot",
        "seed": outcome.seed,
        "participants": len(outcome.reports),
        "behaviours": _by_behaviour(outcome.reports),
        "acknowledged_pages": outcome.reckoning.num_pages,
        "acknowledged_rows": outcome.reckoning.num_entries,
        "lost": list(outcome.reckoning.lost),
        "doubled": list(outcome.reckoning.doubled),
        "stuck": [f"bot {report.plan.number}: {report.reason}" for report in outcome.stuck],
    }


def _by_behaviour(reports: "Sequence[Report]") -> dict[str, dict[str, int]]:
    """Count endings, acknowledged pages and requests by behaviour, in the order in which behaviours are listed."""
    from webapp.bots.behaviours import BEHAVIOURS

    counted: dict[str, dict[str, int]] = {}
    for name in BEHAVIOURS:
        of_name = [report for report in reports if report.plan.behaviour.name == name]
        if of_name:
            endings = {ending: sum(report.ending == ending for report in of_name) for ending in _ENDINGS}
            num_pages = sum(report.ledger.num_pages for report in of_name)
            counted[name] = {"started": len(of_name), **endings, "acknowledged_pages": num_pages}
    return counted


def _tables(outcome: _Outcome) -> "list[RenderableType]":
    from rich.table import Table

    counted = _by_behaviour(outcome.reports)
    columns = [name for name in _COLUMNS if name in _ALWAYS or any(counts[name] for counts in counted.values())]
    table = Table(title=f"Bots in {outcome.study}, seed {outcome.seed}")
    table.add_column("Behaviour", no_wrap=True)
    for name in columns:
        table.add_column(_COLUMNS[name], justify="right")
    for behaviour, counts in counted.items():
        table.add_row(behaviour, *(str(counts[name]) for name in columns))
    found = outcome.reckoning
    lines = [
        f"Acknowledged: {found.num_pages} pages with {found.num_entries} rows.",
        f"Lost: {len(found.lost)}. Doubled: {len(found.doubled)}.",
        *(f"Lost: {line}" for line in found.lost[:_LISTED]),
        *(f"Doubled: {line}" for line in found.doubled[:_LISTED]),
        *(f"Bot {report.plan.number} ({report.plan.behaviour.name}): {report.reason}" for report in outcome.stuck),
    ]
    return [table, *lines]
