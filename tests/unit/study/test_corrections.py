"""A correction can only be what could have been answered."""

import pytest

from tests.web.studies import BACKGROUND, CHECKS, QUIZ, a_study
from webapp.study.answers import PREFER_NOT_TO_SAY
from webapp.study.corrections import Asked, ImpossibleAnswerError
from webapp.study.session import Page, PageKind, Trial

STUDY = a_study(background=BACKGROUND, quiz=QUIZ, attention_checks=CHECKS)
EXPERIMENT = STUDY.experiments[0]
TRIAL = Trial(EXPERIMENT.id, 1, 1, EXPERIMENT.layouts[0], "full", None)


def asked(kind: PageKind) -> Asked:
    trial = TRIAL if kind in {"rating", "probe", "satisfaction"} else None
    return Asked(STUDY, Page(1, kind, trial, None if trial is None else 1), ("left", "right"))


@pytest.mark.parametrize(
    ("kind", "file", "question", "values"),
    [
        ("rating", "ratings", "general", ("1", "5")),
        ("satisfaction", "ratings", "satisfaction_9", ("1", "5")),
        ("probe", "probes", "1", ("left", "right")),
        ("rating", "answers", "check-a", ("1", "5")),
        ("background", "answers", "age", ("16", "120", PREFER_NOT_TO_SAY)),
        ("background", "answers", "gender", ("woman", PREFER_NOT_TO_SAY)),
        ("background", "answers", "robots", ("my brother's",)),
        ("quiz", "answers", "goal", ("key", "flag")),
        ("quiz", "answers", "not asked any more", ("anything",)),
    ],
)
def test_what_could_have_been_answered_can_stand(
    kind: PageKind, file: str, question: str, values: tuple[str, ...]
) -> None:
    for value in values:
        asked(kind).check(file, question, value)


@pytest.mark.parametrize(
    ("kind", "file", "question", "values", "wish"),
    [
        ("rating", "ratings", "general", ("0", "6", "9", "banana", "3.0", "03", "٣", ""), "from 1 to 5"),
        ("satisfaction", "ratings", "satisfaction_9", ("0", "6"), "from 1 to 5"),
        ("probe", "probes", "1", ("up", "Left", ""), "use left, right"),
        ("rating", "answers", "check-a", ("0", "6", PREFER_NOT_TO_SAY), "from 1 to 5"),
        ("background", "answers", "age", ("15", "121", "young", "1" * 40), "from 16 to 120"),
        ("background", "answers", "gender", ("Woman",), "use woman, man, another, prefer_not_to_say"),
        ("quiz", "answers", "goal", ("flags", PREFER_NOT_TO_SAY), "use key, flag, door"),
    ],
)
def test_what_nobody_could_have_answered_cannot(
    kind: PageKind, file: str, question: str, values: tuple[str, ...], wish: str
) -> None:
    for value in values:
        with pytest.raises(ImpossibleAnswerError, match=f"cannot be answered there; .*{wish}"):
            asked(kind).check(file, question, value)


def test_the_scale_is_that_of_the_item() -> None:
    item = EXPERIMENT.items[0].model_copy(update={"points": 7})
    experiment = EXPERIMENT.model_copy(update={"items": (item,)})
    longer = Asked(STUDY.model_copy(update={"experiments": (experiment,)}), Page(1, "rating", TRIAL, 1))
    longer.check("ratings", item.id, "7")
    with pytest.raises(ImpossibleAnswerError, match=r"'8' .* from 1 to 7"):
        longer.check("ratings", item.id, "8")
