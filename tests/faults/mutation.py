"""Change the program in small ways and see whether its tests notice: allocation, submission, export escaping, sign-in.

    python -m tests.faults.mutation [--area sign-in] [--again] [--most 50]
    python -m tests.faults.mutation --report

Everything happens in a copy of the tree. Mutmut makes its mutants there; `source_changes` makes those that it leaves
out. A mutant is killed if a test fails. With `--most 50`, at most so many of either sort are drawn from each module, in
turns from each function, always the same ones. The counts and the survivors are written to
results/evidence/mutants.json, and `--report` writes docs/mutants.md from them. `--again` tries only those that survived
the recorded run, which is enough after tests were added and nothing else was changed.
"""

import argparse
import difflib
import hashlib
import json
import random
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

from tests.conftest import ROOT
from tests.evidence.results import made as made_now
from tests.evidence.results import read_results, write_result
from tests.faults.mutation_areas import AREAS, SHARE_TO_REACH, Area
from tests.faults.mutation_page import write_page
from tests.faults.source_changes import Change, changes
from tests.faults.tree_copy import copy_of_the_tree

RESULT = "mutants"
_SETTINGS = """
[tool.mutmut]
source_paths = ["webapp"]
only_mutate = {modules}
also_copy = ["templates", "static", "docs", "deploy", ".ci", "constraints.txt", "README.md"]
pytest_add_cli_args_test_selection = {tests}
use_git_change_detection = false
track_dependencies = false
timeout_constant = 5.0
timeout_multiplier = 4.0
"""
# What mutmut notes of a mutant is the exit status of pytest, or one of its own.
_SURVIVED, _NO_TEST, _TIMED_OUT = {0}, {5, 33}, {24, -24, 36, 152, 255}
_SHORTEST_LIMIT_S = 30.0

# The names that mutmut will give its mutants of some modules, by module.
_NAMES = """
import json, sys
from pathlib import Path
from mutmut.mutation.file_mutation import mutate_file_contents
print(json.dumps({
    module: [f"{module[:-3].replace('/', '.')}.{name}" for name in
             mutate_file_contents(module, Path(module).read_text(encoding="utf-8")).mutant_names]
    for module in sys.argv[1:]
}))
"""
_SEED = 20310301

_One = TypeVar("_One")
Survivor = Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of one mutant.

    Attributes:
        module: Where it is.
        fate: `killed`, `timed_out`, `survived` or `no_test`.
        key: By what it is found again.
        by: Whether mutmut made it or this project.
        diff: The changed lines; empty for one that did not survive.
    """

    module: str
    fate: str
    key: str
    by: str
    diff: tuple[str, ...] = ()

    @property
    def is_alive(self) -> bool:
        """Whether no test noticed."""
        return self.fate in {"survived", "no_test"}


def main(arguments: Sequence[str] | None = None) -> int:
    """Test mutants or write the page; return 0 if enough are killed in every area."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--area", choices=[area.name for area in AREAS], help="this one only, the others as recorded")
    parser.add_argument("--again", action="store_true", help="only those that survived the recorded run")
    parser.add_argument("--most", type=int, help="draw at most so many mutants of each sort from each module")
    parser.add_argument("--report", action="store_true", help="write docs/mutants.md from what is recorded")
    parser.add_argument("--note", default="", help="what else one should know of this run")
    options = parser.parse_args(arguments)
    if not options.report:
        for area in AREAS:
            if options.area in {None, area.name}:
                _record(area, options.note, options.most, again=options.again)
    results = read_results()
    if RESULT not in results:
        parser.error("nothing is recorded yet; run this without --report first")
    print(write_page(results[RESULT]))
    return results[RESULT].status


def _record(area: Area, note: str, most: int | None, *, again: bool) -> None:
    """Test the mutants of one area and put what came of them beside what is recorded of the others."""
    recorded = read_results().get(RESULT)
    known = {told["test"]: told for told in recorded.told} if recorded else {}
    sources = {module: hashlib.sha256((ROOT / module).read_bytes()).hexdigest()[:16] for module in area.tests}
    before = known.get(area.name) if again else None
    if again and (before is None or before["sources"] != sources):
        raise SystemExit(f"{area.name}: the recorded run was of other modules; run it without --again")
    with copy_of_the_tree() as folder:
        made, mutmuts, ours = _chosen(area, folder, before, most)
        outcomes = [*_of_mutmut(area, folder, mutmuts), *_of_our_own(area, folder, ours)]
    known[area.name] = _told(area, outcomes, sources, made, before)
    told = [known[one.name] for one in AREAS if one.name in known]
    enough = all(one["killed_share"] >= SHARE_TO_REACH for one in told) and len(told) == len(AREAS)
    result = made_now(told, 0 if enough else 1, "python -m tests.faults.mutation", note)
    write_result(RESULT, replace(result, versions={**result.versions, "mutmut": version("mutmut")}))


def _told(
    area: Area, outcomes: Sequence[Outcome], sources: object, made: int, before: Survivor | None
) -> dict[str, Any]:
    modules: dict[str, Counter[str]] = {module: Counter() for module in area.tests}
    if before is not None:
        modules = {module: Counter(counts) for module, counts in before["modules"].items()}
        for survivor in before["survivors"]:
            modules[survivor["module"]][survivor["fate"]] -= 1
    for outcome in outcomes:
        modules[outcome.module][outcome.fate] += 1
    counts: Counter[str] = sum(modules.values(), Counter())
    killed = counts["killed"] + counts["timed_out"]
    return {
        "test": area.name,
        "killed_share": round(killed / counts.total(), 4),
        "made": made if before is None else before.get("made", counts.total()),
        "modules": {module: dict(found) for module, found in modules.items()},
        "sources": sources,
        "survivors": [
            {"module": one.module, "fate": one.fate, "key": one.key, "by": one.by, "diff": list(one.diff)}
            for one in outcomes
            if one.is_alive
        ],
    }


def _chosen(
    area: Area, folder: Path, before: Survivor | None, most: int | None
) -> tuple[int, set[str], dict[str, list[tuple[str, Change]]]]:
    """Return how many mutants there are, mutmut's names of those to test, and our own changes to test by module."""
    _let_mutmut_see(folder, area.tests)
    names = json.loads(_python(folder, "-c", _NAMES, *area.tests))
    ours = {
        module: [(_key(module, change), change) for change in changes((folder / module).read_text(encoding="utf-8"))]
        for module in area.tests
    }
    num_made = sum(map(len, names.values())) + sum(map(len, ours.values()))
    if before is not None:
        wanted = {survivor["key"] for survivor in before["survivors"]}
        mutmuts = {name for found in names.values() for name in found if name in wanted}
        return num_made, mutmuts, {module: [one for one in ours[module] if one[0] in wanted] for module in ours}
    mutmuts = {
        name for found in names.values() for name in drawn(found, most, lambda name: name.partition("__mutmut")[0])
    }
    return (
        num_made,
        mutmuts,
        {module: drawn(found, most, lambda one: one[1].function) for module, found in ours.items()},
    )


def drawn(found: Sequence[_One], most: int | None, function_of: Callable[[_One], str]) -> list[_One]:
    """Draw at most so many, in turns from every function, always the same; all of them if `most` is None."""
    if most is None or len(found) <= most:
        return list(found)
    shuffled = random.Random(_SEED).sample(list(found), len(found))
    turns: Counter[str] = Counter()
    order: list[tuple[int, int]] = []
    for one in shuffled:
        turns[function_of(one)] += 1
        order.append((turns[function_of(one)], len(order)))
    chosen = sorted(range(len(shuffled)), key=order.__getitem__)[:most]
    return [shuffled[index] for index in chosen]


def _of_mutmut(area: Area, folder: Path, names: set[str]) -> Iterator[Outcome]:
    """Let mutmut make its mutants of one module after the other, test those of these names, and tell of each."""
    for module, tests in area.tests.items():
        wanted = sorted(name for name in names if name.startswith(f"{module[:-3].replace('/', '.')}.x"))
        if not wanted:
            continue
        print(f"{module}: {len(wanted)} mutants of mutmut", flush=True)
        _let_mutmut_see(folder, {module: tests})
        said = _mutmut(folder, "run", "--max-children", "1", *wanted)
        notes = json.loads((folder / "mutants" / f"{module}.meta").read_text(encoding="utf-8"))["exit_code_by_key"]
        for name in wanted:
            if notes[name] is None:
                raise SystemExit(f"mutmut did not test {name}:\n{said[-3000:]}")
            fate = _fate(notes[name])
            diff = _diff_lines(_mutmut(folder, "show", name)) if fate in {"survived", "no_test"} else ()
            yield Outcome(module, fate, name, "mutmut", diff)
        shutil.rmtree(folder / "mutants")


def _let_mutmut_see(folder: Path, tests: Mapping[str, Sequence[str]]) -> None:
    """Write mutmut's settings: of these modules, by these tests."""
    path = folder / "pyproject.toml"
    ours = path.read_text(encoding="utf-8").partition(_SETTINGS.splitlines()[1])[0]
    chosen = list(dict.fromkeys(test for module in tests.values() for test in module))
    path.write_text(ours + _SETTINGS.format(modules=json.dumps(list(tests)), tests=json.dumps(chosen)), "utf-8")


def _fate(status: int) -> str:
    if status in _SURVIVED:
        return "survived"
    if status in _NO_TEST:
        return "no_test"
    return "timed_out" if status in _TIMED_OUT else "killed"


def _mutmut(folder: Path, *words: str) -> str:
    return _python(folder, "-m", "mutmut", *words)


def _python(folder: Path, *words: str) -> str:
    finished = subprocess.run([sys.executable, *words], cwd=folder, check=False, capture_output=True, text=True)
    if finished.returncode:
        raise SystemExit(f"{' '.join(words[:3])} failed:\n{finished.stdout[-3000:]}{finished.stderr[-3000:]}")
    return finished.stdout


def _of_our_own(area: Area, folder: Path, chosen: Mapping[str, Sequence[tuple[str, Change]]]) -> Iterator[Outcome]:
    """Make each change that mutmut does not, one after the other, and yield what became of it."""
    command = [sys.executable, "-m", "tests.faults.forked_tests"]
    with subprocess.Popen(command, cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as tester:
        for module, tests in area.tests.items():
            if not chosen[module]:
                continue
            print(f"{module}: {len(chosen[module])} changes of our own", flush=True)
            path = folder / module
            original = path.read_text(encoding="utf-8")
            status, seconds = _ask(tester, tests, 600)
            if status != 0:
                raise SystemExit(f"the tests of {module} fail without any change (status {status})")
            limit_s = max(_SHORTEST_LIMIT_S, 4 * seconds)
            for key, change in chosen[module]:
                path.write_text(change.source, encoding="utf-8")
                status, _ = _ask(tester, tests, limit_s)
                fate = {0: "survived", 5: "no_test", None: "timed_out"}.get(status, "killed")
                pair = (original.splitlines(), change.source.splitlines())
                diff = _diff_lines("\n".join(difflib.unified_diff(*pair, n=0, lineterm="")))
                yield Outcome(module, fate, key, "xar", diff if fate in {"survived", "no_test"} else ())
            path.write_text(original, encoding="utf-8")


def _key(module: str, change: Change) -> str:
    return f"{module}:{change.line} {hashlib.sha256(change.source.encode()).hexdigest()[:12]}"


def _ask(tester: "subprocess.Popen[str]", tests: Sequence[str], limit_s: float) -> tuple[int | None, float]:
    assert tester.stdin is not None
    assert tester.stdout is not None
    print(json.dumps([["-x", "-q", *tests], limit_s]), file=tester.stdin, flush=True)
    status, seconds = json.loads(tester.stdout.readline())
    return status, seconds


def _diff_lines(diff: str) -> tuple[str, ...]:
    """Return the lines of a diff that were taken out and put in."""
    return tuple(line for line in diff.splitlines() if line[:1] in {"-", "+"} and line[:3] not in {"---", "+++"})


if __name__ == "__main__":
    sys.exit(main())
