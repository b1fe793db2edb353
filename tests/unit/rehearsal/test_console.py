from dataclasses import replace

from rich.console import Console, RenderableType

from webapp.rehearsal.beside_ratings import Shown
from webapp.rehearsal.console import shown_beside, verdicts_beside_effects
from webapp.rehearsal.verdicts import Verdict
from webapp.study.analysis_plan import Contrast

POINTS = Shown("1", "difference in points", "subgoals", -0.99, -0.2, -0.41, 0.01, "")


def rendered(*pages: RenderableType) -> str:
    console = Console(width=110)
    with console.capture() as captured:
        for page in pages:
            console.print(page)
    return " ".join(captured.get().split())


def test_numbers_below_nothing_have_a_minus_sign() -> None:
    verdict = Verdict(Contrast("1", "subgoals", "full"), "general", -0.5, -0.2, -0.7, 0.3, 0.4, "missed")
    told = rendered(verdicts_beside_effects([verdict]), *shown_beside([POINTS]))
    for number in ("\u22120.5 ", "\u22120.20 [\u22120.70, 0.30]", "\u22120.99", "\u22120.20 [\u22120.41, 0.01]"):
        assert number in told
    assert "-0" not in told


def test_planted_points_are_explained_once_and_shares_are_not() -> None:
    share = replace(POINTS, what="right predictions", planted=0.6)
    told = rendered(*shown_beside([POINTS, POINTS, share]))
    assert told.count("rounding and the ends of the scale take a little off") == 1
    assert "rounding" not in rendered(*shown_beside([share]))
