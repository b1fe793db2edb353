"""The bots' part of a rehearsal: through the real pages of a real server, and into a data set."""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from webapp.bots.effects import Effects
from webapp.bots.errors import BotError
from webapp.bots.mix import parse_mix
from webapp.bots.plan import make_plan
from webapp.bots.reckoning import reckon
from webapp.bots.running import Report, run
from webapp.bots.server import a_server
from webapp.bots.surroundings import surroundings_on
from webapp.config import Config
from webapp.stimuli.catalogue import Catalogue
from webapp.storage.database import open_database
from webapp.storage.dataset import export
from webapp.storage.wanted import Wanted, bundles_in

_LIMIT_S = 600.0
"""The seconds that each bot has."""


@dataclass(frozen=True, slots=True)
class Cast:
    """Who takes part.

    Attributes:
        num_bots: How many.
        mix: Their behaviours, as `xar bots` takes them; effects are as planted only if all are attentive.
        effects: What is planted.
        seed: Of all that bots decide.
        workers: How many take part at a time.
    """

    num_bots: int
    mix: str
    effects: Effects
    seed: int
    workers: int


def perform(
    config: Config, catalogue: Catalogue, cast: Cast, folder: Path, now: datetime, on_end: Callable[[], None]
) -> None:
    """Let bots take part on a stage and export what is stored of them.

    Args:
        config: The stage.
        catalogue: The study that is served there.
        cast: Who takes part.
        folder: Where the data set goes.
        now: The time of the export.
        on_end: Told of each bot that is done.

    Raises:
        BotError: The mix cannot be read, a bot got stuck, or something was lost or doubled.
        ExportError: The data set cannot be written.
    """
    plans = make_plan(parse_mix(cast.mix), cast.num_bots, catalogue.study.languages[:1], cast.seed)
    with a_server(config) as site, open_database(config, make=False) as database:
        around = surroundings_on(site, database, config, catalogue, cast.effects)
        reports = run(plans, around, num_workers=cast.workers, limit_s=_LIMIT_S, on_end=lambda _report: on_end())
        _refuse_trouble(reports, [*(reckoned := reckon(reports, database)).lost, *reckoned.doubled])
        export(database, folder, Wanted(config.study, None, "bot", find_bundle=bundles_in(config.instance)), now)


def _refuse_trouble(reports: tuple[Report, ...], wrong_rows: list[str]) -> None:
    stuck = [report for report in reports if report.reason]
    if stuck:
        first = stuck[0]
        raise BotError(f"{len(stuck)} of {len(reports)} bots got stuck; number {first.plan.number}: {first.reason}")
    if wrong_rows:
        raise BotError(f"{len(wrong_rows)} rows were lost or doubled; the first: {wrong_rows[0]}")
