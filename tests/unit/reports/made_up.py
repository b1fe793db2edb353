"""A study as the report takes it, made by hand: ratings by chance, and sections that hold one block of each sort."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from webapp.reports.assembly import Assembled, Maker, assemble
from webapp.reports.blocks import Assumption, Cell, Column, Drawing, Figure, Section, Statement, Table
from webapp.reports.in_doubt import VERDICTS
from webapp.reports.origin import Origin
from webapp.reports.study_data import StudyData
from webapp.study.analysis_plan import Plan, default_contrasts, default_equivalences

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

ITEMS = ("general", "likeliness", "loveliness")
KINDS: Mapping[str, tuple[str, ...]] = {
    "1": ("full", "subgoals", "random"),
    "2": ("all_key_points", "first_key_point"),
}
EFFECTS = {"subgoals": 0.9, "all_key_points": 0.3, "random": -0.4}
PEOPLE = 24

ORIGIN = Origin(
    files={"data/description-ratings_data.csv": "1a" * 32, "data/description-participants_data.csv": "2b" * 32},
    code="3c" * 32,
    versions={"python": "3.11.2", "xar": "0.1.0", "numpy": "2.4.0", "scipy": "1.17.1", "matplotlib": "3.11.2"},
    asked={"include_incomplete": False, "changed_data_ok": False, "mode": "live"},
)


def made_up_study(**changes: Any) -> StudyData:  # noqa: ANN401 - whatever the field holds.
    """Return a study of 24 people with ratings of three items, four people more who are not analysed, and no plan."""
    ratings = _ratings()
    people = sorted(set(ratings["participant"]))
    kept: dict[str, Any] = {
        "study": "sakai2021",
        "study_version": "4d" * 32,
        "mode": "live",
        "ratings": ratings,
        "participants": pd.DataFrame({"participant": people}),
        "everybody": _everybody(people),
        "answers": None,
        "probes": None,
        "drives": None,
        "declared": None,
        "wordings": {item: f"How {item}?" for item in ITEMS},
        "points": {(experiment, item): 5 for experiment in KINDS for item in ITEMS},
        "plan": made_up_plan(),
    }
    return StudyData(**(kept | changes))


def made_up_plan(**changes: Any) -> Plan:  # noqa: ANN401 - the same.
    """Return the default plan of the two experiments."""
    kept: dict[str, Any] = {
        "contrasts": tuple(each for name, kinds in KINDS.items() for each in default_contrasts(name, kinds)),
        "equivalences": tuple(each for name, kinds in KINDS.items() for each in default_equivalences(name, kinds)),
        "items": dict.fromkeys(KINDS, ITEMS),
    }
    return Plan(**(kept | changes))


def made_up_report(data: StudyData | None = None, makers: Mapping[str, Maker] | None = None) -> Assembled:
    """Return a report with sections of one block of each sort."""
    return assemble(data or made_up_study(), ORIGIN, {"ordinal": planned, "looks": looks} if makers is None else makers)


def planned(data: StudyData) -> Section:
    """Return a section with planned comparisons whose numbers are made up."""
    columns = (
        Column("experiment", "Experiment"),
        Column("contrast", "Comparison"),
        Column("item", "Item"),
        Column("d", "d", "number"),
        Column("d_low", "95 % from", "number"),
        Column("d_high", "to", "number"),
        Column("p", "p", "p"),
        Column("p_holm", "p (Holm)", "p"),
    )
    tests = [(each, item) for each in data.plan.contrasts for item in data.plan.items_of(each)]
    rows: list[tuple[Cell, ...]] = []
    for place, (contrast, item) in enumerate(tests):
        d = 0.9 - 0.2 * place
        numbers = (d, d - 0.35, d + 0.35, 0.0001 * 3**place, min(1.0, 0.0009 * 3**place))
        rows.append((contrast.experiment, str(contrast), item, *(numbers if place < len(tests) - 1 else 5 * (None,))))
    return Section(
        "ordinal",
        "Planned comparisons: ordinal mixed model",
        ("Each item of each experiment has a model of its own.", Table("planned", "Planned", columns, tuple(rows))),
        (Assumption("Wald's test", "people are drawn independently", "by design", "by design"),),
    )


def looks(data: StudyData) -> Section:
    """Return a section with a figure, a drawing, a wide and a long table, a statement and all verdicts."""
    wide = tuple(Column(f"column_{place}", f"Column {place}", "number", 3) for place in range(11))
    long = (Column("place", "Place", "count"), Column("word", "Word"))
    return Section(
        "looks",
        "One of each",
        (
            Figure("bars", "Mean ratings by kind, with 95 % intervals", "Three bars: 1, 2 and 3.", (6.5, 2.6), _bars),
            Drawing("box", "A drawing", "A box with the word Analysed.", _BOX),
            Table("wide", "A table that is wider than a phone", (Column("name", "Name"), *wide), _wide_rows()),
            Table("long", "A table that is longer than a page", long, tuple((n, f"word {n}") for n in range(1, 91))),
            Statement(
                "the equivalence of <full> & subgoals", f"only {len(data.participants)} people saw both, not 200."
            ),
        ),
        tuple(
            Assumption(f"test {verdict}", "differences are symmetric about 0", "skewness 0.12, n = 24", verdict)
            for verdict in VERDICTS
        ),
    )


_BOX = (
    '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 400 90" width="400" height="90">'
    '<style>rect{fill:#fff;stroke:#000}text{font:15px sans-serif}</style><rect x="5" y="5" width="390" height="80"/>'
    '<text x="20" y="50">Analysed (n = 24)</text></svg>'
)


def _wide_rows() -> tuple[tuple[Cell, ...], ...]:
    return tuple((name, *(1234.5 * (place - 5) / 7 for place in range(11))) for name in ("first", "second"))


def _bars(canvas: "Canvas") -> None:
    axes = canvas.subplots()
    axes.bar(["full", "subgoals", "random"], [1, 2, 3], yerr=[0.2, 0.3, 0.2], color="#0072B2")
    axes.set_ylabel("mean rating")


def _ratings() -> pd.DataFrame:
    stream = np.random.default_rng(7)
    rows = []
    for number in range(PEOPLE):
        own = stream.normal(0, 0.8)
        for experiment, kinds in KINDS.items():
            for trial, kind in enumerate(np.roll(kinds, number), 1):
                for item in ITEMS:
                    latent = own + EFFECTS.get(str(kind), 0.0) + stream.normal()
                    rating = int(np.clip(np.round(3 + latent), 1, 5))
                    layout = f"layout-{experiment}-{trial}"
                    rows.append((f"p{number:02}", experiment, trial, layout, str(kind), 0, item, rating, 1500 + number))
    names = ["participant", "experiment", "trial", "layout", "kind", "draw", "item", "rating", "response_time_ms"]
    return pd.DataFrame(rows, columns=names)


def _everybody(people: list[str]) -> pd.DataFrame:
    reasons = [None] * len(people) + ["incomplete", "incomplete", "straight_lining", "excluded by a researcher"]
    names = [*people, "q1", "q2", "q3", "q4"]
    begun = pd.Series(pd.Timestamp("2031-03-01T09:30:00Z"), index=range(len(names))).dt.as_unit("us")
    return pd.DataFrame(
        {
            "participant": names,
            "consented_at": begun,
            "completed_at": begun.where([reason != "incomplete" for reason in reasons]),
            "withdrawn_at": begun.where([name == "q1" for name in names]),
            "screened_out_at": begun.where([False] * len(names)),
            "num_pages_sent": 11,
            "assignment": " ".join(
                f"{name}/layout-{name}-{place}/{kind}"
                for name, kinds in KINDS.items()
                for place, kind in enumerate(kinds, 1)
            ),
            "reason": pd.Series(reasons, dtype="object"),
        }
    )
