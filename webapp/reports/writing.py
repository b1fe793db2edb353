"""The files of a report, and their folder, which appears complete under `run.json` and is never overwritten."""

import hashlib
import json
import re
from collections.abc import Callable, Mapping
from pathlib import Path

from webapp.reports.assembly import Assembled
from webapp.reports.csv_tables import csv_of
from webapp.reports.figures import files_of
from webapp.reports.html import render
from webapp.reports.methods import methods_text
from webapp.reports.origin import Origin
from webapp.reports.people import headcount
from webapp.reports.study_data import StudyData
from webapp.runs.run_folders import RunFolderError, open_run

REPORT = "report.html"
_LONGEST_STUDY = 40


def name_of_run(data: StudyData, origin: Origin) -> str:
    """Return the name of a run: study, version, hash of the input, and hash of all that its bytes depend on."""
    told = json.dumps(origin.settings(), sort_keys=True).encode()
    study = re.sub(r"[^A-Za-z0-9._-]+", "-", data.study).strip("-._")[:_LONGEST_STUDY]
    parts = [study, data.study_version[:8], origin.input_hash[:8], hashlib.sha256(told).hexdigest()[:8]]
    return "-".join(part for part in parts if part)


def is_there(folder: Path, origin: Origin) -> bool:
    """Say whether a folder holds the complete report of the same files, options, code and versions.

    Raises:
        RunFolderError: It does, and one of its files is not as it was written.
    """
    try:
        settings, about = (json.loads((folder / name).read_bytes()) for name in ("settings.json", "run.json"))
    except (OSError, ValueError):
        return False
    if settings != json.loads(json.dumps(origin.settings())):
        return False
    for name, digest in about["files"].items():
        try:
            content = (folder / name).read_bytes()
        except OSError:
            content = b""
        if hashlib.sha256(content).hexdigest() != digest:
            told = "was changed or removed after the report was written"
            raise RunFolderError(f"{folder / name} {told}; remove the folder, or give another --run")
    return True


def write(folder: Path, data: StudyData, origin: Origin, make: Callable[[], Assembled]) -> Assembled:
    """Make a report and write it into its folder.

    Args:
        folder: Made if it is missing.
        data: What is analysed.
        origin: Where it comes from.
        make: Makes the report, once it is known that the folder is free.

    Raises:
        RunFolderError: The folder is complete, is another run's or no run's, is in use, or cannot be written.
    """
    with open_run(folder, origin.settings()) as run:
        made = make()
        files = files_of_report(made, data, origin)
        for place in {(folder / name).parent for name in files}:
            place.mkdir(exist_ok=True)
        run.complete(files, _about(data, origin, files))
    return made


def files_of_report(made: Assembled, data: StudyData, origin: Origin) -> dict[str, bytes]:
    """Return every file of the folder but `settings.json` and `run.json`, by name."""
    report = made.report
    drawn = {figure.name: files_of(figure) for figure in report.figures}
    found = {REPORT: render(report, {name: files[".svg"] for name, files in drawn.items()})}
    found |= {f"tables/{table.name}.csv": csv_of(table) for table in (*report.tables, report.assumptions())}
    found |= {f"figures/{name}{suffix}": content for name, files in drawn.items() for suffix, content in files.items()}
    found["methods.txt"] = methods_text(data, origin, made.differences)
    if data.plan.text is not None:
        found["plan.txt"] = data.plan.text.encode()
    return found


def _about(data: StudyData, origin: Origin, files: Mapping[str, bytes]) -> dict[str, object]:
    """Return what `run.json` says: what was analysed and what came out, without times and places."""
    people = headcount(data)
    return {
        "study": data.study,
        "study_version": data.study_version,
        "mode": data.mode,
        "participants_analysed": people.analysed,
        "participants_not_analysed": dict(people.reasons),
        "ratings_analysed": people.ratings,
        "input_hash": origin.input_hash,
        "files": {name: hashlib.sha256(content).hexdigest() for name, content in sorted(files.items())},
    }
