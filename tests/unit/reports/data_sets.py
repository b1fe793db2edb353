"""Small data sets as files: six people in two experiments of the paper's study, whole and to be spoiled."""

import csv
import hashlib
import io
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

VERSION = "4d" * 32
STUDY_FILE = Path(__file__).parents[3] / "webapp" / "studies" / "sakai2021" / "study.toml"
ITEMS = ("likeliness", "loveliness", "general")
LAYOUTS = {
    "1": ("experiment1-a", "experiment1-b", "experiment1-c"),
    "2": ("experiment2-a", "experiment2-b"),
}
KINDS = {"1": ("full", "subgoals", "random"), "2": ("all_key_points", "first_key_point")}
PEOPLE = tuple(f"person{number}" for number in range(6))

Row = dict[str, str]
Tables = dict[str, list[Row]]

_WHO = {"study": "sakai2021", "study_version": VERSION, "mode": "live"}


def tables(people: Sequence[str] = PEOPLE, **who: str) -> Tables:
    """Return the rows of a whole data set, everybody complete and nobody excluded."""
    scope = _WHO | who
    return {
        "ratings": [
            scope | {"participant": person} | rating
            for number, person in enumerate(people)
            for rating in _ratings(number)
        ],
        "participants": [scope | _participant(number, person) for number, person in enumerate(people)],
        "allocation": [
            scope | _draw(number, person, experiment) for number, person in enumerate(people) for experiment in KINDS
        ],
        "decisions": [],
        "quality": [],
    }


def text_of(rows: Iterable[Mapping[str, str]], columns: Sequence[str] | None = None) -> str:
    """Return rows as CSV text."""
    kept = list(rows)
    out = io.StringIO(newline="")
    writer = csv.DictWriter(out, columns or list(kept[0]), lineterminator="\r\n")
    writer.writeheader()
    writer.writerows(kept)
    return out.getvalue()


def write_plain(folder: Path, data: Mapping[str, list[Row]]) -> Path:
    """Write the tables that have rows by their plain names, and return the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, rows in data.items():
        if rows:
            (folder / f"{name}.csv").write_bytes(text_of(rows).encode())
    return folder


def write_exported(folder: Path, data: Mapping[str, list[Row]], study_file: bytes | None = None) -> Path:
    """Write the tables that have rows as an export has them, with the study file and a manifest."""
    files = {f"data/description-{name}_data.csv": text_of(rows).encode() for name, rows in data.items() if rows}
    if study_file is not None:
        files[f"studies/sakai2021-{VERSION[:12]}/study.toml"] = study_file
    levels = [{"termCode": item, "name": f"How {item}?"} for item in ITEMS]
    variables = [{"name": "item", "valueReference": levels}, {"name": "rating", "maxValue": 5}]
    files["dataset_description.json"] = json.dumps({"variableMeasured": variables}).encode()
    told = {name: {"sha256": hashlib.sha256(content).hexdigest()} for name, content in files.items()}
    files["manifest.json"] = json.dumps({"format": 1, "files": told}).encode()
    for name, content in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    return folder


def decision(person: str, action: str, record: int, **told: str) -> Row:
    """Return a row of `decisions.csv`."""
    empty = dict.fromkeys(("page", "file", "question", "from", "to"), "")
    who = _WHO | {"participant": person, "record": str(record), "at": "2031-03-02T09:00:00.000000Z", "by": "ann"}
    return who | {"action": action, "reason": "typed wrongly"} | empty | told


def flag(person: str, rule: str, *, flagged: bool = True) -> Row:
    """Return a row of `quality.csv`."""
    return _WHO | {"participant": person, "rule": rule, "value": "", "limit": "", "flagged": str(flagged).lower()}


def _shown(number: int, experiment: str) -> list[tuple[str, str]]:
    kinds = KINDS[experiment]
    return [(layout, kinds[(number + place) % len(kinds)]) for place, layout in enumerate(LAYOUTS[experiment])]


def _ratings(number: int) -> Iterable[Row]:
    for experiment in KINDS:
        for trial, (layout, kind) in enumerate(_shown(number, experiment), start=1):
            for place, item in enumerate(ITEMS):
                yield {
                    "experiment": experiment,
                    "trial": str(trial),
                    "layout": layout,
                    "kind": kind,
                    "draw": str(number) if kind == "random" else "",
                    "item": item,
                    "rating": str(1 + (number + trial + place) % 5),
                    "response_time_ms": "" if number == 0 else str(1000 * trial),
                    "submitted_at": f"2031-03-01T09:{30 + trial}:00.000017Z",
                }


def _participant(number: int, person: str) -> Row:
    drawn = " ".join(
        "/".join([experiment, layout, kind, *([str(number)] if kind == "random" else [])])
        for experiment in KINDS
        for layout, kind in _shown(number, experiment)
    )
    return {
        "participant": person,
        "consented_at": "2031-03-01T09:30:00.000017Z",
        "completed_at": f"2031-03-01T10:{number % 60:02}:00.000000Z",
        "withdrawn_at": "",
        "screened_out_at": "",
        "num_pages_sent": "11",
        "assignment": drawn,
        "excluded_at": "",
    }


def _draw(number: int, person: str, experiment: str) -> Row:
    return {
        "participant": person,
        "record": str(10 + number),
        "experiment": experiment,
        "arrangement": str(number % len(KINDS[experiment])),
        "layout_order": "0",
    }
