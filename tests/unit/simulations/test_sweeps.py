"""A sweep of learning runs: the same rows whoever works, resumed without repeating one, and what it finds."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import pandas as pd
import pytest

from webapp.runs.run_folders import RunFolder, open_run
from webapp.simulations import count, sweeps, usefulness
from webapp.simulations.claims import Claim, compare_groups
from webapp.simulations.conditions import Condition
from webapp.simulations.schedulers import Scheduler
from webapp.simulations.settings import QUICK, SweepSettings
from webapp.simulations.sweeps import COLUMNS, sweep
from webapp.simulations.tasks import read_task
from webapp.simulations.usefulness import pairs_behind_the_start

ALONE = Scheduler(workers=1)
TINY = SweepSettings(
    layout="######\n#K#..#\n#.D..#\n#^#.G#\n######\n",
    layout_name="tiny",
    num_runs=3,
    runs_per_stack=4,
    num_resamples=200,
    fresh=replace(QUICK["fresh"], num_slots=4, max_episodes=12, exploration_steps=2000),
)


def quietly(done: int, total: int) -> None:
    del done, total


def groups() -> list[Condition]:
    task = read_task(TINY.layout, TINY.layout_name)
    told = [
        Condition(f"step {step}", "derived", task.pairs((step,)), (step,), variant, keeps_optimum=True)
        for variant in ("repeatable", "once")
        for step in (2, 6)
    ]
    return [Condition("nothing", "none", (), (), "none", keeps_optimum=True), *told]


def swept(
    path: Path,
    conditions: Sequence[Condition],
    scheduler: Scheduler = ALONE,
    report: Callable[[int, int], None] = quietly,
) -> pd.DataFrame:
    with open_run(path, TINY.to_dict()) as folder:
        return sweep(conditions, TINY, folder, scheduler, report)


class Stopped(KeyboardInterrupt):
    """Somebody pressed Ctrl-C."""


def stop_after(runs: int) -> Callable[[int, int], None]:
    def report(done: int, total: int) -> None:
        del total
        if done >= runs:
            raise Stopped

    return report


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> pd.DataFrame:
    return swept(tmp_path_factory.mktemp("reference"), groups())


def test_there_is_one_row_for_every_run_in_the_order_of_the_groups(reference: pd.DataFrame) -> None:
    assert tuple(reference.columns) == COLUMNS
    expected = [f"{group.variant}/{group.name.replace(' ', '-')}/{n:03d}" for group in groups() for n in range(3)]
    assert reference["run_id"].tolist() == expected
    assert reference["episodes"].between(1, 12).all()
    assert (reference.loc[reference["is_optimal"] == 0, "episodes"] == 12).all()


def test_two_workers_give_the_rows_of_one(tmp_path: Path, reference: pd.DataFrame) -> None:
    rows = swept(tmp_path, groups(), Scheduler(workers=2))
    assert rows.to_csv() == reference.to_csv()


def test_an_interrupted_sweep_goes_on_and_repeats_no_row(tmp_path: Path, reference: pd.DataFrame) -> None:
    with pytest.raises(Stopped):
        swept(tmp_path, groups(), report=stop_after(8))
    with open_run(tmp_path, TINY.to_dict()) as folder:
        kept = {row["run_id"] for rows in folder.finished.values() for row in rows}
    assert 8 <= len(kept) < len(reference)
    told: list[tuple[int, int]] = []
    rows = swept(tmp_path, groups(), report=lambda *numbers: told.append(numbers))
    assert rows.to_csv() == reference.to_csv()
    assert told[0] == (len(kept), len(reference))
    assert told[-1] == (len(reference), len(reference))
    journal = (tmp_path / "journal.jsonl").read_text().splitlines()
    assert len(journal) == len(set(journal)) == 4  # 15 runs in stacks of 4, each of them written once.


def test_what_another_group_is_told_changes_no_row_of_the_others(tmp_path: Path, reference: pd.DataFrame) -> None:
    changed = groups()
    task = read_task(TINY.layout, TINY.layout_name)
    changed[1] = replace(changed[1], name="step 7", pairs=task.pairs((7,)), steps=(7,))
    rows = swept(tmp_path, changed)
    theirs = ~reference["condition"].eq("step 2") | reference["variant"].eq("once")
    assert rows[theirs].to_csv() == reference[theirs].to_csv()
    assert rows.loc[3, "run_id"] == "repeatable/step-7/000"


def test_a_worker_of_another_version_is_refused() -> None:
    with pytest.raises(sweeps.OtherCode, match="a worker has another version of xar; install the same one everywhere"):
        sweeps._learn_stack(TINY.layout, (), TINY.fresh, 0, "another")


def test_other_seeds_learn_otherwise(tmp_path: Path, reference: pd.DataFrame) -> None:
    other = replace(TINY, seed=7)
    with open_run(tmp_path, other.to_dict()) as folder:
        rows = sweep(groups(), other, folder, ALONE, quietly)
    assert rows["actions"].tolist() != reference["actions"].tolist()


@pytest.mark.parametrize("experiment", [usefulness, count])
def test_the_quick_mode_runs_every_part_and_gives_the_same_files_for_the_same_rows(
    experiment: Any,  # noqa: ANN401 - a module.
    tmp_path: Path,
) -> None:
    settings = replace(experiment.SETTINGS["quick"], num_runs=2, fresh=replace(QUICK["fresh"], max_episodes=8))
    with open_run(tmp_path, settings.to_dict()) as folder:
        rows = experiment.run(settings, folder, ALONE, quietly)
    files = experiment.summarise(settings, rows)
    assert files == experiment.summarise(settings, rows)
    name = experiment.NAME
    assert {"rows.csv", "conditions.csv", "comparisons.csv", "claims.csv", "summary.md"} < set(files)
    assert {f"{name}.svg", f"{name}.png", "learned.svg", "learned.png"} < set(files)
    again = pd.read_csv(BytesIO(files["rows.csv"]))
    assert again["run_id"].tolist() == rows["run_id"].tolist()


@pytest.mark.slow
def test_pairs_behind_the_start_do_not_come_out_as_useful_and_derived_subgoals_do(tmp_path: Path) -> None:
    settings = SweepSettings(num_runs=8, runs_per_stack=16, fresh=replace(SweepSettings().fresh, max_episodes=90))
    task = read_task(settings.layout, settings.layout_name)
    nothing = Condition("nothing", "none", (), (), "none", keeps_optimum=True)
    derived = Condition("derived", "derived", task.pairs((7, 16)), (7, 16), "repeatable", keeps_optimum=True)
    useless = Condition("behind", "useless", pairs_behind_the_start(task, 2), (), "once", keeps_optimum=False)
    made = [
        Claim("told pairs help", "ours", "fewer", derived, nothing),
        Claim("told pairs help", "ours", "fewer", useless, nothing),
    ]
    with open_run(tmp_path, settings.to_dict()) as folder:
        rows = sweep([nothing, derived, useless], settings, folder, Scheduler(workers=2), quietly)
    found = compare_groups(made, rows, settings).set_index("first")
    assert found.loc["derived", "verdict"] == "holds"
    assert found.loc["behind", "verdict"] != "holds"
    assert found.loc["behind", "improvement"] < 0.5


def test_a_folder_keeps_each_stack_as_soon_as_it_is_done(tmp_path: Path) -> None:
    seen: list[int] = []
    with open_run(tmp_path, TINY.to_dict()) as folder:
        sweep(groups(), TINY, folder, ALONE, lambda *_: seen.append(_num_lines(folder)))
    assert seen == [0, 1, 2, 3, 4]


def _num_lines(folder: RunFolder) -> int:
    return len((folder.path / "journal.jsonl").read_text().splitlines())
