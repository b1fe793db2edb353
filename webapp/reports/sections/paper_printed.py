"""What is wrong with the numbers that the paper prints, computed from these numbers alone and stated, not repaired."""

from collections.abc import Iterator

from webapp.analysis.printed_tests import denominators_with_critical, fitting_denominators, p_of_f, p_of_variances
from webapp.reports.blocks import Block, Cell, Column, Table
from webapp.reports.formatting import p_clause
from webapp.reports.sections.paper_numbers import (
    CELLS,
    GENERAL,
    NUM_PARTICIPANTS,
    PRINTED_F,
    PRINTED_FREEDOM,
    RATINGS_EACH,
    SIMPLE_EFFECTS,
    VARIANCES,
    PrintedF,
)

_EFFECTS = {"first": "likeliness", "second": "loveliness", "interaction": "interaction"}
_READINGS = ((3, 98), (1, 98), (1, NUM_PARTICIPANTS * RATINGS_EACH - len(CELLS)))
"""Degrees of freedom that one may read into the print, or would expect."""


def printed_anova() -> Iterator[Block]:
    """Say why the printed analysis of variance cannot be right as it stands, with the numbers that show it."""
    columns = (
        Column("effect", "Effect"),
        Column("f", "Printed F"),
        Column("p", "Printed p"),
        *(Column(f"p_{a}_{b}", f"p with F({a}, {b})", "p") for a, b in _READINGS),
        Column("fits", "df that fit, F(1, df)"),
    )
    title = "What the paper prints of its analysis of variance, and what fits it"
    note = "A denominator fits where some F that rounds to the printed one has a p that rounds to the printed one."
    yield Table("printed_f_tests", title, columns, tuple(_row(one) for one in PRINTED_F), note)
    yield _verdict_on_freedom()


def printed_direction() -> str:
    """Say that a printed one-sided p value cannot be of the hypothesis that it is given for."""
    low, high = CELLS[False, False], CELLS[False, True]
    p_value = SIMPLE_EFFECTS[False].value or 0.0
    return (
        f"Where likeliness is low, the paper prints {p_clause(p_value)} of a one-sided test, with means of {low.text} "
        f"(loveliness low) and {high.text} (high). The mean is lower where loveliness is higher, so a test of the "
        "hypothesis that more loveliness goes with a higher general rating has p > .5 "
        f"({p_clause(1 - p_value)}, if the printed value is of the other direction). Either the direction was chosen "
        "by the data, or the alternative was that less loveliness goes with a higher rating."
    )


def printed_variances() -> str:
    """Say what an F test makes of the printed variances."""
    first, second = (VARIANCES["2", kind, GENERAL] for kind in ("all_key_points", "first_key_point"))
    p_value = p_of_variances(first.value or 1.0, second.value or 1.0, (NUM_PARTICIPANTS, NUM_PARTICIPANTS))
    return (
        f"The paper compares variances of {first.text} (all key points) and {second.text} (the first) without a test. "
        f"If {NUM_PARTICIPANTS} people rated each, the F test of these two numbers, two-sided and for independent "
        f"normal values, has {p_clause(p_value)}."
    )


def joint_denominators() -> tuple[int, ...]:
    """Return the denominators that fit every printed F whose p is printed as a number, ascending."""
    fitting = [set(fitting_denominators(one.statistic, one.p_value)) for one in PRINTED_F if not one.is_upper_bound]
    return tuple(sorted(set.intersection(*fitting)))


def _row(one: PrintedF) -> tuple[Cell, ...]:
    p_values = [p_of_f(float(one.statistic), freedoms) for freedoms in _READINGS]
    fits = None if one.is_upper_bound else _span(fitting_denominators(one.statistic, one.p_value))
    printed = f"{'< ' if one.is_upper_bound else ''}{one.p_value}"
    return _EFFECTS[one.effect], one.statistic, printed, *p_values, fits


def _verdict_on_freedom() -> str:
    joint, critical = joint_denominators(), denominators_with_critical(PRINTED_FREEDOM)
    cells = len(CELLS)
    return (
        f'The paper prints "F({PRINTED_FREEDOM})" three times, which is no pair of degrees of freedom. Read as F(3, '
        "98) it contradicts both p values, and an effect of two levels has one degree of freedom, not three. Read as "
        f"F(1, 98) it misses the p of loveliness. Together, both p values that are printed as numbers fit only df from "
        f"{_span(joint)}, that is some {joint[0] + cells} to {joint[-1] + cells} ratings. {NUM_PARTICIPANTS} people "
        f"with {RATINGS_EACH} ratings each in {cells} cells have F(1, {_READINGS[2][1]}). The number {PRINTED_FREEDOM} "
        f"happens to be the critical value of F(1, df) at .05 for df from {_span(critical)}. Which ratings entered "
        "cannot be told from the print; nothing is repaired here."
    )


def _span(numbers: tuple[int, ...]) -> str:
    return f"{numbers[0]} to {numbers[-1]}" if numbers else "none"
