import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from webapp.analysis.printed_tests import denominators_with_critical, fitting_denominators, p_of_f


def test_what_is_printed_in_the_paper_fits_the_denominators_found_by_hand() -> None:
    loveliness, interaction = fitting_denominators("2.20", ".143"), fitting_denominators("6.56", ".012")
    assert (loveliness[0], loveliness[-1]) == (53, 77)
    assert (interaction[0], interaction[-1]) == (72, 142)
    assert sorted(set(loveliness) & set(interaction)) == list(range(72, 78))
    assert denominators_with_critical("3.98") == tuple(range(67, 72))
    assert [round(p_of_f(f, (1, 98)), 3) for f in (2.20, 6.56)] == [0.141, 0.012]
    assert [round(p_of_f(f, (1, 176)), 3) for f in (2.20, 6.56)] == [0.140, 0.011]


@given(st.floats(0.5, 12), st.integers(5, 900), st.integers(1, 3))
def test_the_true_denominator_always_fits_what_is_printed_of_it(
    statistic: float, denominator: int, numerator: int
) -> None:
    p_value = stats.f.sf(statistic, numerator, denominator)
    found = fitting_denominators(f"{statistic:.2f}", f"{p_value:.3f}", numerator)
    assert denominator in found


@pytest.mark.parametrize("denominator", [10, 70, 500])
def test_a_critical_value_is_one_of_its_own_denominator(denominator: int) -> None:
    printed = f"{stats.f.isf(0.05, 1, denominator):.2f}"
    assert denominator in denominators_with_critical(printed)
