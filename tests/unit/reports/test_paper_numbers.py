from webapp.reports.sections.paper_numbers import (
    CELLS,
    COMPARISONS,
    CORRELATIONS,
    KINDS,
    MEANS,
    SIMPLE_EFFECTS,
    VARIANCES,
    paper_experiment,
)


def test_a_printed_number_is_the_text_that_stands_for_it() -> None:
    for printed in (*MEANS.values(), *VARIANCES.values(), *CORRELATIONS.values(), *CELLS.values()):
        assert printed.value is not None
        assert float(printed.text.removeprefix("> ")) == printed.value
        assert printed.is_lower_bound is printed.text.startswith(">")
        assert printed.place.startswith(("section 6.", "table 1"))
    assert float(SIMPLE_EFFECTS[False].text.removeprefix("p = ")) == SIMPLE_EFFECTS[False].value


def test_every_number_is_of_kinds_that_its_experiment_has() -> None:
    for experiment, kind, _ in (*MEANS, *VARIANCES):
        assert kind in KINDS[experiment]
    for experiment, kinds, _ in COMPARISONS:
        assert kinds <= KINDS[experiment]


def test_an_experiment_is_the_papers_if_it_has_its_kinds_and_no_others() -> None:
    assert paper_experiment(["random", "full", "subgoals"]) == "1"
    assert paper_experiment(("first_key_point", "all_key_points")) == "2"
    assert paper_experiment(["full", "subgoals", "random", "none"]) is None
    assert paper_experiment([]) is None
