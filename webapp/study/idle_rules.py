"""Exclusion rules that nothing in the study could ever break: declared by mistake, or a section is missing."""

from collections.abc import Iterator, Sequence

from webapp.study.experiments import Experiment
from webapp.study.sections import Quality

_Problem = tuple[Sequence[str | int], str]

_FEWEST_TO_COMPARE = 2
"""Of rating pages, and of ratings on one, before equal answers say anything."""


def idle_rules(
    quality: Quality, experiments: Sequence[Experiment], *, num_checks: int, has_quiz: bool, is_recruited: bool
) -> Iterator[_Problem]:
    """Yield the rules that mark nobody whatever people do, each with the path of the setting.

    Args:
        quality: The declared rules.
        experiments: Those of the study.
        num_checks: How many attention checks there are.
        has_quiz: Whether there is a quiz.
        is_recruited: Whether a recruiter's ids are stored.
    """
    limit = quality.failed_attention_checks
    if limit is not None and limit > num_checks:
        there_are = "there is 1 check" if num_checks == 1 else f"there are {num_checks} checks"
        yield ("quality", "failed_attention_checks"), f"is {limit}, and {there_are}; declare [[attention_checks]]"
    if quality.failed_quiz and not has_quiz:
        yield ("quality", "failed_quiz"), "is true, and there is no quiz; declare [quiz]"
    if quality.duplicates and not is_recruited:
        yield ("quality", "duplicates"), "is true, and no recruiter's id is stored to compare; declare [recruitment]"
    if quality.straight_lining and not _can_be_straight(experiments):
        wish = "it needs at least 2 trials and at least 2 items"
        yield ("quality", "straight_lining"), f"is true, and equal answers would say nothing; {wish}"


def _can_be_straight(experiments: Sequence[Experiment]) -> bool:
    num_pages = sum(len(experiment.layouts) for experiment in experiments)
    most_items = max((len(experiment.items) for experiment in experiments), default=0)
    return num_pages >= _FEWEST_TO_COMPARE and most_items >= _FEWEST_TO_COMPARE
