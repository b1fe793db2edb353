"""Time the chance of reaching a state against Storm and SciPy's direct solve, with the error that each one makes.

python -m tests.benchmarks.reachability

The chain is that of a key-door world: a room of n x n floor cells, cut in two by a wall column of n more with a door in
row n // 3; the key lies left of it in the row last but one, the goal in the last corner. A state is a cell, one of four
headings, and how far the agent has come: without the key, with the key, with the door open; only those that can be
reached are states, 10 n^2 but for a few. The actions are the five of the key-door rules. The policy takes a shortest
path, ties by the lowest action index, and slips in one of ten steps into one of the other four actions, each alike.

Asked for, in every state: the chance of being in one state before the goal, the one after 85 % of the shortest path.
No graph search answers that, nearly all states are undecided. Every solver is given the finished chain. The errors are
the largest differences from a solution of our own that is certified to 1e-11, which each peer's answer confirms to
within the peer's error. Times are processor seconds of one thread, the median of interleaved runs, so that other work
on the machine does not count. Each size runs in a process of its own, and so does SciPy's solve, for at most 120 s.
"""

import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, eye_array
from scipy.sparse.linalg import spsolve

from webapp.explainer.reachability import chain_reach_probability

ROOMS = {100: 15, 316: 5}
"""Cells along a side, and how often each solver runs: 100,000 and 998,560 states."""
PROMISE = 2.0
SLIP = 0.1
OURS = 1e-6
"""The error bound that is asked for; the error is far smaller."""
SCIPY_SECONDS = 120
STEPS_X, STEPS_Y = np.array([1, 0, -1, 0]), np.array([0, 1, 0, -1])

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """A chain `[S, S]`, empty in its ends, and the set `[S]` to be reached."""

    chain: csr_array
    targets: Bools


def key_door_table(side: int) -> tuple[NDArray[np.int32], Bools, int]:
    """Return `[S, 5]` next states, `[S]` where the goal is, and the start, of the world described above."""
    width, half = side + 1, side // 2
    door, key, goal = (half, side // 3), (half // 2, side - 2), (side, side - 1)
    stage, y, x, heading = np.meshgrid(np.arange(3), np.arange(side), np.arange(width), np.arange(4), indexing="ij")
    possible = ((x != half) | ((y == door[1]) & (stage == 2))) & (
        (stage > 0) | ((x < half) & ((x != key[0]) | (y != key[1])))
    )
    index = np.full(possible.shape, -1, dtype=np.int32)
    index[possible] = np.arange(np.count_nonzero(possible), dtype=np.int32)
    stage, y, x, heading = (axis[possible] for axis in (stage, y, x, heading))
    own = index[stage, y, x, heading]
    ahead_x, ahead_y = x + STEPS_X[heading], y + STEPS_Y[heading]
    inside = (ahead_x >= 0) & (ahead_x < width) & (ahead_y >= 0) & (ahead_y < side)
    cell = index[stage, np.clip(ahead_y, 0, side - 1), np.clip(ahead_x, 0, width - 1), heading]
    forward = np.where(inside & (cell >= 0), cell, own)
    taking = (stage == 0) & (ahead_x == key[0]) & (ahead_y == key[1])
    turning = (stage > 0) & (ahead_x == door[0]) & (ahead_y == door[1])
    table = np.stack(
        [
            forward,
            index[stage, y, x, (heading - 1) % 4],
            index[stage, y, x, (heading + 1) % 4],
            np.where(taking, index[1, y, x, heading], own),
            np.where(turning, index[np.where(stage > 0, 3 - stage, 0), y, x, heading], own),
        ],
        axis=1,
    )
    ended = (x == goal[0]) & (y == goal[1])
    table[ended] = own[ended, None]
    return table, ended, int(index[0, 0, 0, 0])


def distances(table: NDArray[np.int32], ended: Bools) -> NDArray[np.int64]:
    """Return `[S]`: the actions to the goal, by the frontiers of a search from it."""
    after = csr_array(
        (np.ones(table.size), (table.ravel(), np.repeat(np.arange(len(table)), table.shape[1]))),
        shape=(len(table), len(table)),
    )
    distance, frontier = np.where(ended, 0, -1), np.flatnonzero(ended)
    while len(frontier):
        found = np.unique(after[frontier].indices)
        frontier, last = found[distance[found] < 0], distance[frontier[0]]
        distance[frontier] = last + 1
    return distance


def problem(side: int) -> Problem:
    """Return the chain of the slipping policy, and the state after 85 % of its shortest path."""
    table, ended, state = key_door_table(side)
    distance, num_states = distances(table, ended), len(table)
    policy = np.argmin(distance[table], axis=1)
    path = [state]
    while not ended[path[-1]]:
        path.append(int(table[path[-1], policy[path[-1]]]))
    chances = np.full(table.shape, SLIP / 4)
    chances[np.arange(num_states), policy] = 1 - SLIP
    alive = np.flatnonzero(~ended)
    entries = (chances[alive].ravel(), (np.repeat(alive, 5), table[alive].ravel()))
    return Problem(
        csr_array(entries, shape=(num_states, num_states)), np.arange(num_states) == path[len(path) * 85 // 100]
    )


def storm_check(asked: Problem, precision: float | None = None, *, eigen: bool = False) -> Callable[[], Floats]:
    """Build Storm's model, and return the call that checks it: by its default, to a precision, or by Eigen."""
    import stormpy  # noqa: PLC0415 - only for the platforms that it is made for.

    num_states = asked.chain.shape[0]
    row_start, columns, chances = (
        part.tolist() for part in (asked.chain.indptr, asked.chain.indices, asked.chain.data)
    )
    builder = stormpy.datastructures.SparseMatrixBuilder[float](num_states, num_states, force_dimensions=False)
    for state in range(num_states):
        if row_start[state] == row_start[state + 1]:
            builder.add_next_value(state, state, 1.0)
        for entry in sorted(range(row_start[state], row_start[state + 1]), key=columns.__getitem__):
            builder.add_next_value(state, columns[entry], chances[entry])
    labels = stormpy.models.StateLabeling(num_states)
    for label, states in (("init", [0]), ("target", np.flatnonzero(asked.targets).tolist())):
        labels.add_label(label)
        for state in states:
            labels.add_label_to_state(label, state)
    parts = stormpy.models.SparseModelComponents(transition_matrix=builder.build(), state_labeling=labels)
    model = stormpy.models.SparseDtmc[float](parts)
    formula = stormpy.parse_properties('P=? [F "target"]')[0]
    environment: Any = stormpy.environments.Environment()
    if eigen:
        environment.solver().set_linear_equation_solver_type(stormpy.environments.EquationSolverType.EIGEN)
    if precision is not None:
        set_precision(environment, precision)

    def check() -> Floats:
        result = stormpy.model_checking(model, formula, environment=environment)
        return np.array(result.get_value_vector())

    return check


def set_precision(environment: Any, precision: float) -> None:  # noqa: ANN401 - Storm's classes come untyped.
    """Make Storm iterate to another precision than its default, 1e-6; its native solver alone takes one."""
    import stormpy  # noqa: PLC0415

    solver = environment.solver()
    solver.set_linear_equation_solver_type(stormpy.environments.EquationSolverType.NATIVE)
    solver.native().precision = stormpy.Rational(precision)


def scipy_solve(asked: Problem) -> Floats:
    """Solve the same equations by SuperLU with its default order, ends and targets as rows of the identity."""
    chain, targets = asked.chain, asked.targets
    rows = (~targets).astype(np.float64)
    inner = csr_array((chain.data * np.repeat(rows, np.diff(chain.indptr)), chain.indices, chain.indptr), chain.shape)
    found: Floats = spsolve((eye_array(chain.shape[0]) - inner).tocsc(), targets.astype(np.float64))
    return found


def main() -> int:
    """Print times, errors and memory at both sizes, and return 0 if the promises are kept."""
    print(f"{'states':>9} {'solver':34} {'CPU s':>8} {'error':>9}")
    kept, per_transition = [], []
    for side in ROOMS:
        lines = _child("time", side).splitlines()
        scipy_line = _child("scipy", side, seconds=SCIPY_SECONDS)
        rows = [line.split("\t") for line in [*lines, scipy_line or f"SciPy spsolve\tover {SCIPY_SECONDS} s\t-\t-"]]
        for name, seconds, error, states in rows:
            print(f"{states:>9} {name:34} {seconds:>8} {error:>9}")
        kept.append(_judge(rows))
        peak, growth, transitions = map(float, _child("memory", side).split())
        per_transition.append(growth / transitions)
        print(
            f"{'':9} our peak {peak / 1e6:.0f} MB, {per_transition[-1]:.0f} bytes per transition of {transitions:.0f}"
        )
    linear = per_transition[-1] <= 1.5 * per_transition[0]
    print(f"memory per transition grows {per_transition[-1] / per_transition[0]:.2f} times", _verdict(kept=linear))
    return 0 if all(kept) and linear else 1


def _judge(rows: list[list[str]]) -> bool:
    """Print how much faster we are than the fastest peer at its default, and whether our error is no larger."""
    ours = rows[0]
    peers = [row for row in rows[1:] if "precision" not in row[0] and not row[1].startswith("over")]
    fastest = min(peers, key=lambda row: float(row[1]))
    ratio = float(fastest[1]) / float(ours[1])
    exact = float(ours[2]) <= float(fastest[2])
    print(
        f"{'':9} {ratio:.2f} times faster than {fastest[0]}, promised {PROMISE}: {_verdict(kept=ratio >= PROMISE)};",
        end=" ",
    )
    print(f"error no larger: {_verdict(kept=exact)}")
    return ratio >= PROMISE and exact


def _verdict(*, kept: bool) -> str:
    return "kept" if kept else "BROKEN"


def _child(task: str, side: int, seconds: float | None = None) -> str:
    words = [sys.executable, "-m", "tests.benchmarks.reachability", task, str(side)]
    try:
        run = subprocess.run(words, check=True, capture_output=True, text=True, timeout=seconds)
    except subprocess.TimeoutExpired:
        return ""
    return run.stdout.strip()


def _time(side: int) -> None:
    asked = problem(side)
    exact = chain_reach_probability(asked.chain, asked.targets, precision=1e-11)
    default = storm_check(asked)
    solvers: dict[str, Callable[[], Floats]] = {
        f"ours, error bound {OURS:.0e}": lambda: (
            chain_reach_probability(asked.chain, asked.targets, precision=OURS).values
        ),
        "Storm, default": default,
    }
    seconds: dict[str, list[float]] = {name: [] for name in solvers}
    values = {}
    for _ in range(ROOMS[side]):
        for name, solve in solvers.items():
            values[name] = _timed(solve, seconds[name])
    error = float(np.abs(values[next(iter(solvers))] - exact.values).max())
    matched = f"Storm, precision {error:.0e}"
    seconds[matched] = []
    values[matched] = _timed(storm_check(asked, error), seconds[matched])
    for name, spent in seconds.items():
        off = float(np.abs(values[name] - exact.values).max())
        print(name, f"{statistics.median(spent):.3f}", f"{off:.1e}", len(exact.values), sep="\t")


def _timed(solve: Callable[[], Floats], seconds: list[float]) -> Floats:
    began = time.process_time()
    values = solve()
    seconds.append(time.process_time() - began)
    return values


def _scipy(side: int) -> None:
    asked = problem(side)
    exact = chain_reach_probability(asked.chain, asked.targets, precision=1e-11)
    seconds: list[float] = []
    values = _timed(lambda: scipy_solve(asked), seconds)
    print("SciPy spsolve", f"{seconds[0]:.3f}", f"{np.abs(values - exact.values).max():.1e}", len(values), sep="\t")


def _memory(side: int) -> None:
    """Build the chain in a process that ends, so that its own peak does not hide the solver's."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([sys.executable, "-m", "tests.benchmarks.reachability", "store", str(side), folder], check=True)
        parts = {name: np.load(f"{folder}/{name}.npy") for name in ("data", "indices", "indptr", "targets")}
    size = len(parts["targets"])
    chain = csr_array((parts["data"], parts["indices"], parts["indptr"]), shape=(size, size))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    chain_reach_probability(chain, parts["targets"], precision=OURS)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(peak * 1024, (peak - before) * 1024, chain.nnz)


def _store(side: int, folder: str) -> None:
    asked = problem(side)
    for name, part in (
        ("data", asked.chain.data),
        ("indices", asked.chain.indices),
        ("indptr", asked.chain.indptr),
        ("targets", asked.targets),
    ):
        np.save(f"{folder}/{name}.npy", part)


if __name__ == "__main__":
    os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    match sys.argv[1:]:
        case []:
            sys.exit(main())
        case ["time", side]:
            _time(int(side))
        case ["scipy", side]:
            _scipy(int(side))
        case ["memory", side]:
            _memory(int(side))
        case ["store", side, folder]:
            _store(int(side), folder)
