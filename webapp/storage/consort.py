"""The flow of participants, in the manner of CONSORT 2010: who was allocated to what, who dropped out, who is analysed.

Whoever came and did not agree is stored nowhere, so the flow begins with the consent. Everybody is allocated at that
moment, and the study is within participants: an arrangement says which kinds of explanation go with which layouts.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal, cast, get_args

from sqlalchemy import Connection, func, select

from webapp.storage.people import exclusion_states
from webapp.storage.people_rows import state, trials_in_order
from webapp.storage.scope import Mode, Scope
from webapp.storage.streams import Alongside, stream
from webapp.storage.tables import arrangements, participants, records
from webapp.storage.variables import WHO, Variable
from webapp.storage.wanted import Wanted

Fate = Literal["withdrawn", "screened_out", "in_progress", "completed"]
FATES: tuple[Fate, ...] = get_args(Fate)

CONSORT = (
    *(variable for variable in WHO if variable.name != "participant"),
    Variable("experiment", "text", "The experiment; empty for the study as a whole."),
    Variable("group", "text", "Whom it is about: `all`, `arrangement` or `kind`; a participant is in several kinds."),
    Variable("name", "text", "The arrangement's number and order of layouts, or the kind; empty for `all`."),
    Variable("kinds", "text", "The kinds of an arrangement in the order in which they were shown; empty otherwise."),
    Variable("step", "text", "The step of the flow."),
    Variable("reason", "text", "Of exclusions: the reason; empty for their sum and for the other steps."),
    Variable("n", "integer", "How many participants.", unit="participants", minimum=0),
)
"""The columns of `consort.csv`."""


@dataclass(slots=True)
class Counts:
    """How many of a group went which way.

    Attributes:
        allocated: All of them.
        fates: Where they are now.
        excluded: How many of those who completed are excluded, by reason.
        excluded_others: How many of the others are excluded too; they are not analysed anyway.
        included: How many of those who did not complete are analysed all the same, as an analysis may be asked to.
    """

    allocated: int = 0
    fates: Counter[Fate] = field(default_factory=Counter)
    excluded: Counter[str] = field(default_factory=Counter)
    excluded_others: int = 0
    included: int = 0

    @property
    def analysed(self) -> int:
        """How many are left: they completed the study, or are included all the same, and are not excluded."""
        return self.fates["completed"] - self.excluded.total() + self.included

    @property
    def dropped(self) -> int:
        """How many did not complete the study, those under way included."""
        return self.allocated - self.fates["completed"]

    def take(self, fate: Fate, reason: str | None) -> None:
        """Count a participant."""
        self.allocated += 1
        self.fates[fate] += 1
        if reason is not None and fate == "completed":
            self.excluded[reason] += 1
        elif reason is not None:
            self.excluded_others += 1

    def as_json(self) -> dict[str, object]:
        """Return the numbers, by step."""
        return {
            "allocated": self.allocated,
            "dropped": {fate: self.fates[fate] for fate in FATES[:-1]},
            "completed": self.fates["completed"],
            "excluded": dict(sorted(self.excluded.items())),
            "excluded_of_those_who_dropped_out": self.excluded_others,
            "analysed": self.analysed,
        }


@dataclass(slots=True)
class Flow:
    """The flow of one version of a study in one mode.

    Attributes:
        scope: Whose flow it is.
        everybody: All participants who are still in the data.
        num_erased: How many more there were, of whom everything was erased at their wish.
        arrangements: By experiment, arrangement and order of layouts.
        kinds_of: The kinds of each of these, in the order in which they were shown.
        kinds: By experiment and kind.
    """

    scope: Scope
    everybody: Counts = field(default_factory=Counts)
    num_erased: int = 0
    arrangements: dict[tuple[str, int, int], Counts] = field(default_factory=dict)
    kinds_of: dict[tuple[str, int, int], tuple[str, ...]] = field(default_factory=dict)
    kinds: dict[tuple[str, str], Counts] = field(default_factory=dict)

    def as_json(self) -> dict[str, object]:
        """Return the flow for `consort.json`."""
        return {
            "study": self.scope.study,
            "study_version": self.scope.study_version,
            "mode": self.scope.mode,
            "erased": self.num_erased,
            "everybody": self.everybody.as_json(),
            "arrangements": [
                {
                    "experiment": key[0],
                    "arrangement": key[1],
                    "layout_order": key[2],
                    "kinds": list(self.kinds_of[key]),
                    **counts.as_json(),
                }
                for key, counts in sorted(self.arrangements.items())
            ],
            "kinds": [
                {"experiment": experiment, "kind": kind, **counts.as_json()}
                for (experiment, kind), counts in sorted(self.kinds.items())
            ],
        }


def read_flows(connection: Connection, wanted: Wanted) -> Sequence[Flow]:
    """Count the flow of each version of a study in each mode, live ones first."""
    excluded = {one: exclusion.reason for one, exclusion in exclusion_states(connection).items()}
    drawn = Alongside(trials_in_order(connection, wanted), key=lambda row: row[0])
    placed = Alongside(_placed(connection, wanted), key=lambda row: row[0])
    flows: dict[Scope, Flow] = {}
    people = participants.c
    query = select(people.id, people.study, people.study_version, people.mode, state).where(wanted.of(participants))
    for participant_id, study, version, mode, fate in stream(connection, query.order_by(people.id)):
        scope = Scope(study, version, cast("Mode", mode))
        flow = flows.setdefault(scope, Flow(scope))
        shown: dict[str, list[str]] = {}
        for _, _, _, experiment, _, kind, _ in drawn.of(participant_id):
            shown.setdefault(experiment, []).append(kind)
        cells = {(experiment, arrangement, order) for _, experiment, arrangement, order in placed.of(participant_id)}
        flow.kinds_of |= {cell: tuple(shown.get(cell[0], ())) for cell in cells if cell not in flow.kinds_of}
        kinds = {(experiment, kind) for experiment, all_kinds in shown.items() for kind in all_kinds}
        for counts in (
            flow.everybody,
            *(flow.arrangements.setdefault(cell, Counts()) for cell in cells),
            *(flow.kinds.setdefault(kind, Counts()) for kind in kinds),
        ):
            counts.take(fate, excluded.get(participant_id))
    for scope, num_erased in _erased(connection, wanted):
        flows.setdefault(scope, Flow(scope)).num_erased = num_erased
    order = {mode: place for place, mode in enumerate(("live", "test", "bot"))}
    return sorted(flows.values(), key=lambda flow: order[flow.scope.mode])


def consort_rows(flows: Sequence[Flow]) -> Iterator[tuple[object, ...]]:
    """Yield the rows of `consort.csv`."""
    for flow in flows:
        who = (flow.scope.study, flow.scope.study_version, flow.scope.mode)
        yield (*who, None, "all", None, None, "erased", None, flow.num_erased)
        groups: list[tuple[tuple[object, ...], Counts]] = [((None, "all", None, None), flow.everybody)]
        for (experiment, arrangement, order), counts in sorted(flow.arrangements.items()):
            kinds = " ".join(flow.kinds_of[experiment, arrangement, order])
            groups.append(((experiment, "arrangement", f"{arrangement}/{order}", kinds), counts))
        groups += [
            ((experiment, "kind", kind, None), counts) for (experiment, kind), counts in sorted(flow.kinds.items())
        ]
        for group, counts in groups:
            yield from ((*who, *group, *step) for step in steps(counts))


def steps(counts: Counts) -> Iterator[tuple[str, str | None, int]]:
    """Yield the steps of a flow in order: name, reason, how many."""
    yield "allocated", None, counts.allocated
    for fate in FATES[:-1]:
        yield fate, None, counts.fates[fate]
    yield "completed", None, counts.fates["completed"]
    yield "excluded", None, counts.excluded.total()
    for reason, n in sorted(counts.excluded.items()):
        yield "excluded", reason, n
    if counts.included:
        yield "included", None, counts.included
    yield "analysed", None, counts.analysed


def _erased(connection: Connection, wanted: Wanted) -> Iterator[tuple[Scope, int]]:
    key = (records.c.study, records.c.study_version, records.c.mode)
    query = select(*key, func.count()).where(records.c.action == "erased", wanted.of(records)).group_by(*key)
    for study, version, mode, count in connection.execute(query):
        yield Scope(study, version, mode), count


def _placed(connection: Connection, wanted: Wanted) -> Iterator[tuple[object, ...]]:
    placed = arrangements.c
    query = (
        select(placed.participant_id, placed.experiment, placed.arrangement, placed.layout_order)
        .join(participants)
        .where(wanted.of(participants))
        .order_by(placed.participant_id, placed.experiment)
    )
    return stream(connection, query)
