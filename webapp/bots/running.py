"""All bots of a run, some at a time, each within its time."""

import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Literal

from webapp.bots.browser import TimeLimit
from webapp.bots.errors import OutOfTimeError, WalkError
from webapp.bots.ledger import Ledger
from webapp.bots.plan import BotPlan
from webapp.bots.walk import Ending, Surroundings, Walk
from webapp.storage.participants import Participant


@dataclass(frozen=True, slots=True)
class Report:
    """How one bot fared.

    Attributes:
        plan: The bot.
        ending: How its part ended: by itself, because its time was over, or at something that it could not get past.
        reason: What that was; empty otherwise.
        ledger: What it sent.
        participant: Which participant it was after its consent; None if it never was one.
        token_hashes: Those of all tokens that it was ever given.
        num_requests: How many requests the server answered.
    """

    plan: BotPlan
    ending: Ending | Literal["out_of_time", "failed"]
    reason: str = ""
    ledger: Ledger = field(default_factory=Ledger)
    participant: Participant | None = None
    token_hashes: frozenset[str] = frozenset()
    num_requests: int = 0


def run(
    plans: Sequence[BotPlan],
    around: Surroundings,
    *,
    num_workers: int,
    limit_s: float,
    on_end: Callable[[Report], None] = lambda _report: None,
) -> tuple[Report, ...]:
    """Let all bots take part, and return when the last one is done.

    The first one arrives alone: if the server does not know it for a bot, no other follows.

    Args:
        plans: The bots, in the order of their starts.
        around: What they share.
        num_workers: How many take part at a time.
        limit_s: The seconds that each has.
        on_end: Told of each that is done, from its own thread.

    Raises:
        webapp.bots.errors.NotLetInAsBotError: The server took one for a person.
    """
    stop, first_is_in = threading.Event(), threading.Event()

    def take_part(plan: BotPlan) -> Report:
        if plan is not plans[0]:
            first_is_in.wait()
        walk = Walk(plan, around, TimeLimit(limit_s, stop))
        try:
            report = _take_part(walk, first_is_in.set)
        except BaseException:
            stop.set()
            raise
        finally:
            first_is_in.set()
            walk.browser.close()
        on_end(report)
        return report

    with ThreadPoolExecutor(num_workers) as pool:
        futures = [pool.submit(take_part, plan) for plan in plans]
        try:
            return tuple(future.result() for future in futures)
        except BaseException:
            stop.set()
            pool.shutdown(cancel_futures=True)
            raise


def _take_part(walk: Walk, is_in: Callable[[], None]) -> Report:
    try:
        has_arrived = walk.arrive()
        is_in()
        return _report(walk, walk.go_on() if has_arrived else "turned_away")
    except OutOfTimeError:
        return _report(walk, "out_of_time", "its time was over")
    except WalkError as error:
        return _report(walk, "failed", str(error))


def _report(walk: Walk, ending: Ending | Literal["out_of_time", "failed"], reason: str = "") -> Report:
    tokens = frozenset(walk.tokens())
    return Report(walk.plan, ending, reason, walk.ledger, walk.participant, tokens, walk.browser.num_requests)
