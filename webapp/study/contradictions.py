"""What no single setting of a study file can see: settings that contradict each other."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, TypeVar

from pydantic import ValidationError

from webapp.study.answers import PREFER_NOT_TO_SAY
from webapp.study.declared import Declared
from webapp.study.experiments import KEY_POINT_KINDS, SATISFACTION_ITEMS, TAILORED_KINDS, Experiment
from webapp.study.idle_rules import idle_rules
from webapp.study.learning_settings import LearningSettings
from webapp.study.own_parts import own_part_problems
from webapp.study.planned_analysis import plan_problems
from webapp.study.sections import (
    AnalysisPlan,
    AttentionCheck,
    Background,
    Consent,
    Debriefing,
    Practice,
    Quality,
    Quiz,
    Recruitment,
    ReturnPath,
)

_Problem = tuple[Sequence[str | int], str]
_Part = TypeVar("_Part", bound=Declared)

_FEWEST_ATTENTION_CHECKS = 2
_ENDINGS = ("completed", "screened_out", "no_consent", "withdrawn")


def contradictions(tree: Mapping[str, Any]) -> Iterator[_Problem]:
    """Yield every contradiction, each with the path of the setting to change.

    It works on the file as read, so that these problems are told together with those of single settings; parts that
    are wrong in themselves are passed over.
    """
    for key in ("languages", "layouts", "facts"):
        yield from _repeated((key,), _texts_of(tree.get(key)))
    layouts = _texts_of(tree.get("layouts"))
    yield from own_part_problems(tree)
    learning = _valid(LearningSettings, tree.get("learning"))
    for layout in learning.seeds if learning else ():
        if layout not in layouts:
            yield ("learning", "seeds", layout), f"is not one of the study's layouts: {', '.join(layouts)}"
    declared = tree.get("experiments")
    experiments = [_valid(Experiment, part) for part in declared] if isinstance(declared, list) else []
    yield from _repeated(
        ("experiments",), [experiment.id if experiment else None for experiment in experiments], key="id"
    )
    for number, experiment in enumerate(experiments):
        for path, message in _within(experiment, layouts) if experiment else ():
            yield ("experiments", number, *path), message
    known = [experiment for experiment in experiments if experiment is not None]
    yield from _sections(tree, known)
    if len(known) == len(experiments):
        # An experiment that is wrong in itself says nothing yet about what others refer to.
        yield from _attention_checks(tree, known)
        yield from _arms(tree, known)
        yield from _quality(tree, known)
        yield from _plan(tree, known)


def _within(experiment: Experiment, layouts: Sequence[str]) -> Iterator[_Problem]:
    yield from _repeated(("layouts",), experiment.layouts)
    yield from _repeated(("kinds",), experiment.kinds)
    yield from _repeated(("items",), [item.id for item in experiment.items], key="id")
    for number, item in enumerate(experiment.items):
        if item.id in SATISFACTION_ITEMS:
            yield ("items", number, "id"), f"is {item.id!r}, an item of the satisfaction scale; use another name"
    for number, layout in enumerate(experiment.layouts):
        if layout not in layouts:
            yield ("layouts", number), f"is {layout!r}, not one of the study's layouts: {', '.join(layouts)}"
    if experiment.situation == "video" and experiment.question is None:
        yield ("situation",), "is 'video', which needs a [experiments.question] that says when it stops"
    if experiment.situation == "current_view" and experiment.question is not None:
        yield ("question",), "belongs to a 'video'; remove it, or let the situation be 'video'"
    yield from _kinds(experiment)


def _kinds(experiment: Experiment) -> Iterator[_Problem]:
    for number, kind in enumerate(experiment.kinds):
        if kind in KEY_POINT_KINDS and experiment.question is None:
            yield ("kinds", number), f"is {kind!r}, which answers a question; declare [experiments.question]"
        if kind in TAILORED_KINDS and experiment.drive is None:
            yield ("kinds", number), f"is {kind!r}, made from the participant's own drive; declare [experiments.drive]"
        if kind == "none" and not (experiment.drive or experiment.probe or experiment.items_for("none")):
            wish = "declare [experiments.drive], [experiments.probe] or an item with without_explanation = true"
            yield ("kinds", number), f"is 'none', of which nothing would be measured; {wish}"


def _sections(tree: Mapping[str, Any], experiments: Sequence[Experiment]) -> Iterator[_Problem]:
    consent = _valid(Consent, tree.get("consent"))
    if consent and consent.guardian_below is not None and consent.guardian_below <= consent.minimum_age:
        wish = f"it should be above the minimum_age, {consent.minimum_age}"
        yield ("consent", "guardian_below"), f"is {consent.guardian_below}; {wish}"
    yield from _practice(tree, experiments)
    yield from _questions(tree)
    yield from _recruitment(tree)
    languages = _texts_of(tree.get("languages"))
    translations = tree.get("translations")
    for language in translations if isinstance(translations, dict) else ():
        if language not in languages[1:]:
            others = ", ".join(languages[1:]) or "none"
            yield ("translations", language), f"is not one of the languages after the first: {others}"


def _practice(tree: Mapping[str, Any], experiments: Sequence[Experiment]) -> Iterator[_Problem]:
    practice = _valid(Practice, tree.get("practice"))
    if practice is None:
        return
    layouts = _texts_of(tree.get("layouts"))
    if practice.layout not in layouts:
        yield (
            ("practice", "layout"),
            f"is {practice.layout!r}, not one of the study's layouts: {', '.join(layouts)}",
        )
    for experiment in experiments:
        if practice.layout in experiment.layouts:
            yield (
                ("practice", "layout"),
                f"is {practice.layout!r}, which experiment {experiment.id!r} uses; add another",
            )


def _questions(tree: Mapping[str, Any]) -> Iterator[_Problem]:
    background = _valid(Background, tree.get("background"))
    questions = background.questions if background else ()
    yield from _repeated(("background", "questions"), [question.id for question in questions], key="id")
    for number, question in enumerate(questions):
        where = ("background", "questions", number)
        yield from _repeated((*where, "choices"), question.choices)
        if (question.type == "choice") != bool(question.choices):
            yield (*where, "choices"), f"belong to the type 'choice' and to no other, and this is {question.type!r}"
        if PREFER_NOT_TO_SAY in question.choices:
            yield (*where, "choices"), f"list {PREFER_NOT_TO_SAY!r}, which is always offered; remove it"
        if question.minimum > question.maximum:
            yield (*where, "minimum"), f"is {question.minimum}, above the maximum, {question.maximum}"
    quiz = _valid(Quiz, tree.get("quiz"))
    asked = quiz.questions if quiz else ()
    yield from _repeated(("quiz", "questions"), [question.id for question in asked], key="id")
    for number, quizzed in enumerate(asked):
        yield from _repeated(("quiz", "questions", number, "choices"), quizzed.choices)
        if quizzed.answer not in quizzed.choices:
            wish = f"it should be one of the choices: {', '.join(quizzed.choices)}"
            yield ("quiz", "questions", number, "answer"), f"is {quizzed.answer!r}; {wish}"


def _attention_checks(tree: Mapping[str, Any], experiments: Sequence[Experiment]) -> Iterator[_Problem]:
    declared = tree.get("attention_checks")
    checks = [_valid(AttentionCheck, part) for part in declared] if isinstance(declared, list) else []
    yield from _repeated(("attention_checks",), [check.id if check else None for check in checks], key="id")
    if 0 < len(checks) < _FEWEST_ATTENTION_CHECKS:
        yield ("attention_checks",), "has a single check; recruiters let nobody be refused for one, so declare two"
    by_id = {experiment.id: experiment for experiment in experiments}
    for number, check in enumerate(checks):
        if check is None:
            continue
        experiment = by_id.get(check.experiment)
        if experiment is None:
            known = ", ".join(by_id) or "none"
            where = ("attention_checks", number, "experiment")
            yield where, f"is {check.experiment!r}; the experiments are {known}"
        elif check.trial > len(experiment.layouts):
            where = ("attention_checks", number, "trial")
            yield where, f"is {check.trial}; experiment {experiment.id!r} has {len(experiment.layouts)} trials"
        elif check.id in {item.id for item in experiment.items}:
            yield ("attention_checks", number, "id"), f"is {check.id!r}, an item of the experiment; use another name"
        elif not all(experiment.items_for(kind) for kind in experiment.kinds):
            where = ("attention_checks", number, "experiment")
            yield where, f"is {check.experiment!r}, where those who see no explanation have no ratings to check"


def _recruitment(tree: Mapping[str, Any]) -> Iterator[_Problem]:
    recruitment = _valid(Recruitment, tree.get("recruitment"))
    for outcome in _ENDINGS if recruitment else ():
        path: ReturnPath = getattr(recruitment, outcome)
        if path.link is not None and "{code}" in path.link and path.code is None:
            yield ("recruitment", outcome, "code"), "is missing, and the link uses it"
        is_paid = recruitment is not None and recruitment.service == "prolific"
        if is_paid and path.code is None and path.link is None and outcome not in _unused(tree):
            yield ("recruitment", outcome), "is missing; give it a code or a link, or these people cannot be told apart"
    yield from _equal_codes(recruitment)


def _unused(tree: Mapping[str, Any]) -> frozenset[str]:
    """Return the endings that nobody meets: without a quiz that ends the study nobody is screened out."""
    quiz = _valid(Quiz, tree.get("quiz"))
    return frozenset() if quiz and quiz.on_failure == "screen_out" else frozenset({"screened_out"})


def _equal_codes(recruitment: Recruitment | None) -> Iterator[_Problem]:
    seen: dict[str, str] = {}
    for outcome in _ENDINGS if recruitment else ():
        code = getattr(recruitment, outcome).code
        if code in seen:
            yield ("recruitment", outcome, "code"), f"is {code!r}, the code of {seen[code]} too; use another"
        elif code is not None:
            seen[code] = outcome


def _arms(tree: Mapping[str, Any], experiments: Sequence[Experiment]) -> Iterator[_Problem]:
    """Yield what is wrong with the debriefing: whoever was deceived has to be told."""
    debriefing = _valid(Debriefing, tree.get("debriefing", {}))
    if debriefing is None:
        return
    is_placebic = any("placebic" in experiment.kinds for experiment in experiments)
    if is_placebic and "placebic" not in debriefing.discloses:
        yield (
            ("debriefing", "discloses"),
            "does not list 'placebic', although there is such an arm; participants have to be told at the end",
        )
    if "placebic" in debriefing.discloses and not is_placebic:
        yield ("debriefing", "discloses"), "lists 'placebic', and no experiment has such an arm; remove it"


def _quality(tree: Mapping[str, Any], experiments: Sequence[Experiment]) -> Iterator[_Problem]:
    quality = _valid(Quality, tree.get("quality", {}))
    if quality is None:
        return
    checks = tree.get("attention_checks")
    yield from idle_rules(
        quality,
        experiments,
        num_checks=len(checks) if isinstance(checks, list) else 0,
        has_quiz="quiz" in tree,
        is_recruited="recruitment" in tree,
    )


def _plan(tree: Mapping[str, Any], experiments: Sequence[Experiment]) -> Iterator[_Problem]:
    plan = _valid(AnalysisPlan, tree.get("analysis"))
    if plan is not None and len({experiment.id for experiment in experiments}) == len(experiments):
        own_kinds = tree.get("kinds")
        yield from plan_problems(plan, experiments, own_kinds if isinstance(own_kinds, dict) else ())


def _repeated(path: Sequence[str | int], values: Sequence[str | None], key: str | None = None) -> Iterator[_Problem]:
    for value, count in Counter(values).items():
        if count > 1 and value is not None:
            second = [i for i, other in enumerate(values) if other == value][1]
            where = (*path, second) if key is None else (*path, second, key)
            yield where, f"is {value!r}, which stands there {count} times; keep one"


def _texts_of(value: object) -> list[str]:
    return [part for part in value if isinstance(part, str)] if isinstance(value, list) else []


def _valid(part: type[_Part], value: object) -> _Part | None:
    try:
        return part.model_validate(value)
    except ValidationError:
        return None
