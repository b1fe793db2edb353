import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from webapp.analysis.independent_columns import independent

TABLES = st.tuples(st.integers(1, 8), st.integers(0, 6)).flatmap(
    lambda shape: arrays(np.float64, shape, elements=st.integers(-2, 2).map(float))
)


@given(TABLES, st.booleans())
def test_a_column_is_kept_if_it_raises_the_rank(table: NDArray[np.float64], constant: bool) -> None:
    named = [(f"c{place}", "c", table[:, place]) for place in range(table.shape[1])]
    found = independent(named, len(table), constant=constant)
    before = np.ones((len(table), int(constant)))
    expected = []
    for name, _, values in named:
        after = np.column_stack([before, values])
        if np.linalg.matrix_rank(after) > (np.linalg.matrix_rank(before) if before.size else 0):
            expected.append(name)
        before = after
    assert [column.name for column in found.kept] == expected
    assert [column.name for column in found.lost] == [name for name, _, _ in named if name not in expected]
    assert found.x.shape == (len(table), len(expected))


def test_columns_keep_their_names_factors_and_values() -> None:
    values = np.array([0.0, 1.0, 2.0])
    (column,) = independent([("within", "rating", values)], 3).kept
    assert (column.name, column.factor, column.values.tolist()) == ("within", "rating", [0.0, 1.0, 2.0])
