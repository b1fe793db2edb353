"""Linear systems of Markov chains: the bound holds, and what cannot be trusted is refused."""

import numpy as np
import pytest
from scipy.sparse import csr_array

from webapp.explainer import policy_sweeps, transient_systems
from webapp.explainer.seeding import stream
from webapp.explainer.transient_systems import NotSolved, TransientSystem


def random_moves(size: int, leak: float) -> csr_array:
    """Four random moves from each state, one of them a step down the numbering, absorbed with the chance `leak`."""
    rng = stream(7, "systems")
    columns = rng.integers(0, size, (size, 4))
    columns[:, 0] = np.maximum(np.arange(size) - 1, 0)
    shares = rng.dirichlet(np.ones(4), size) * (1 - leak)
    return csr_array((shares.ravel(), (np.repeat(np.arange(size), 4), columns.ravel())), shape=(size, size))


@pytest.mark.parametrize("direct_limit", [0, 10**6])
@pytest.mark.parametrize("leak", [0.5, 0.01, 1e-4])
def test_no_answer_is_further_off_than_its_bound(direct_limit: int, leak: float) -> None:
    moves = random_moves(300, leak)
    truth = stream(8, "truth").random(300).astype(np.longdouble)
    right_side = truth - np.einsum("ij,j->i", moves.toarray().astype(np.longdouble), truth)
    solution = TransientSystem(moves, direct_limit=direct_limit).solve(right_side.astype(np.float64))
    # The right side is rounded once, which the inverse magnifies by at most 1 / leak.
    assert np.abs(solution.values - truth).max() <= solution.error_bound + 1.2e-16 / leak
    assert solution.error_bound < 1e-10 / leak


def test_a_large_system_is_solved_by_iteration_as_by_a_factor() -> None:
    moves = random_moves(3000, 0.01)
    right_side = stream(9, "right side").random(3000)
    iterated = TransientSystem(moves, direct_limit=0).solve(right_side)
    direct = TransientSystem(moves).solve(right_side)
    assert iterated.values == pytest.approx(direct.values, abs=iterated.error_bound + direct.error_bound)


def test_a_system_without_unknowns_is_solved() -> None:
    solution = TransientSystem(csr_array((0, 0))).solve(np.zeros(0))
    assert (solution.values.tolist(), solution.error_bound) == ([], 0)


@pytest.mark.parametrize("direct_limit", [0, 10**6])
@pytest.mark.parametrize("stay", [1.0, 1 - 1e-16])
def test_a_chain_that_is_not_absorbed_is_refused(direct_limit: int, stay: float) -> None:
    system = TransientSystem(csr_array(np.array([[0.0, stay], [stay, 0.0]])), direct_limit=direct_limit)
    with pytest.raises(NotSolved, match=r"a system of 2 states"):
        system.solve(np.ones(2))


def walk(size: int, up: float) -> csr_array:
    """A walk on a line, absorbed below its first state; in the last one it waits where it would go up."""
    here = np.arange(size)
    columns = np.concatenate((np.minimum(here + 1, size - 1), here[1:] - 1))
    chances = np.concatenate((np.full(size, up), np.full(size - 1, 1 - up)))
    return csr_array((chances, (np.concatenate((here, here[1:])), columns)), shape=(size, size))


@pytest.mark.parametrize(("size", "up"), [(3_000, 0.5), (50_000, 0.1), (50_000, 0.4)])
def test_a_long_walk_takes_as_many_steps_as_its_formula_says(size: int, up: float) -> None:
    # One level is left after d(k) = 1 / down + up / down * d(k + 1) steps, and the last after 1 / down.
    down, steps = 1 - up, np.empty(size)
    level = 0.0
    for state in reversed(range(size)):
        level = 1 / down if state == size - 1 else 1 / down + up / down * level
        steps[state] = level
    found = TransientSystem(walk(size, up)).solve(np.ones(size))
    truth = np.cumsum(steps)
    assert np.abs(found.values - truth).max() <= found.error_bound + 1e-12 * truth.max()
    assert found.error_bound < 1e-6 * truth.max()


def test_a_cycle_that_is_left_at_one_state_only_is_solved() -> None:
    # Round and round through 5,000 states; in the first, one of ten times it ends instead: 10 rounds on average.
    size = 5_000
    chances = np.ones(size)
    chances[0] = 0.9
    cycle = csr_array((chances, (np.arange(size), (np.arange(size) + 1) % size)), shape=(size, size))
    found = TransientSystem(cycle).solve(np.ones(size))
    # From the first: v = 1 + .9 (4,999 + v), and each other state has only its way to the first before it.
    first = (1 + 0.9 * (size - 1)) / 0.1
    truth = np.append(first, first + np.arange(size - 1, 0, -1))
    assert np.abs(found.values - truth).max() <= found.error_bound + 1e-9
    assert found.error_bound < 1e-6 * truth.max()


def test_waiting_is_left_out_where_the_states_of_a_larger_chain_are_named() -> None:
    chain = csr_array(np.array([[1.0, 1e-17, 1e-17], [0, 0, 0], [0, 0, 0]]))
    system = TransientSystem(chain, np.array([True, False, False]))
    assert system.solve(np.array([1e-17])).values == pytest.approx([0.5])


@pytest.mark.parametrize("direct_limit", [0, 10**6])
def test_one_system_serves_many_right_sides(direct_limit: int) -> None:
    moves = random_moves(200, 0.1)
    system = TransientSystem(moves, direct_limit=direct_limit)
    inverse = np.linalg.inv(np.eye(200) - moves.toarray())
    for column in range(0, 200, 20):
        found = system.solve(np.eye(200)[column])
        assert found.values == pytest.approx(inverse[:, column], abs=found.error_bound + 1e-12)


@pytest.mark.parametrize("right_side", [np.ones(3), np.array([1.0, np.nan])])
def test_a_right_side_that_is_none_is_refused(right_side: np.ndarray) -> None:
    with pytest.raises(ValueError, match=r"a right side must be \[2\] finite numbers"):
        TransientSystem(csr_array((2, 2))).solve(right_side)


def test_a_plane_where_every_second_move_slips_is_solved() -> None:
    # Two of four directions lead to absorption with .7 together; walls wait. By a factor and by sweeps alike.
    size = 60
    y, x = np.divmod(np.arange(size * size), size)
    rows, columns, chances = [], [], []
    for dy, dx, chance in ((0, -1, 0.35), (-1, 0, 0.35), (0, 1, 0.15), (1, 0, 0.15)):
        stays = (y + dy >= 0) & (x + dx >= 0)
        after = np.minimum(y + dy, size - 1) * size + np.minimum(x + dx, size - 1)
        rows.append(np.flatnonzero(stays))
        columns.append(after[stays])
        chances.append(np.full(np.count_nonzero(stays), chance))
    entries = (np.concatenate(chances), (np.concatenate(rows), np.concatenate(columns)))
    plane = csr_array(entries, shape=(size * size, size * size))
    swept = TransientSystem(plane).solve(np.ones(size * size))
    direct = TransientSystem(plane, direct_limit=10**6).solve(np.ones(size * size))
    assert swept.values == pytest.approx(direct.values, abs=swept.error_bound + direct.error_bound)
    assert swept.error_bound < 1e-6


@pytest.mark.parametrize("wish", [1e-4, 1e-2])
def test_a_wish_that_is_looser_than_the_worst_bound_is_honoured_by_the_first_method(
    wish: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise AssertionError("a second method was tried")

    monkeypatch.setattr(transient_systems, "_Factorised", refuse)
    monkeypatch.setattr(transient_systems, "_WORST_BOUND", 1e-12)
    moves = walk(50_000, 0.4)
    right_side = np.zeros(50_000)
    right_side[0] = 0.6
    found = TransientSystem(moves, precision=wish).solve(right_side)
    assert np.abs(found.values - 1).max() <= found.error_bound <= wish
    assert found.error_bound > 1e-12


def test_sweeps_by_a_factor_give_what_sweeps_in_place_give(monkeypatch: pytest.MonkeyPatch) -> None:
    moves = random_moves(3000, 0.01)
    right_side = stream(9, "right side").random(3000)
    in_place = TransientSystem(moves, direct_limit=0).solve(right_side)
    monkeypatch.setattr(policy_sweeps, "_IN_PLACE", False)
    factored = TransientSystem(moves, direct_limit=0).solve(right_side)
    assert in_place.values == pytest.approx(factored.values, abs=in_place.error_bound + factored.error_bound)


@pytest.mark.parametrize("problem", [AttributeError, TypeError, ValueError])
def test_a_scipy_without_its_product_in_place_is_noticed(
    problem: type[Exception], monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object) -> None:
        raise problem

    assert policy_sweeps._adds_row_after_row()
    monkeypatch.setattr(policy_sweeps, "_add_product", refuse)
    assert not policy_sweeps._adds_row_after_row()


def test_a_product_that_takes_its_factor_as_it_was_at_first_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    def at_once(matrix: csr_array, factor: np.ndarray, sums: np.ndarray) -> None:
        sums += matrix @ factor.copy()

    monkeypatch.setattr(policy_sweeps, "_add_product", at_once)
    assert not policy_sweeps._adds_row_after_row()
