"""The texts that a study's own declarations need."""

from webapp.study.protocol import Experiment, Study
from webapp.study.texts import Texts, Wanted


def study_texts(study: Study, texts: Texts) -> dict[str, Wanted]:
    """Return the texts that a study needs for what it declares, by full key.

    An item needs one wording for all experiments, or one for each experiment that asks it. `texts` tells which of the
    two there is.
    """
    required = {f"facts.{fact}": Wanted() for fact in study.facts}
    for experiment in study.experiments:
        required |= _experiment_texts(experiment, texts)
    for question in study.background.questions if study.background else ():
        required[f"background.{question.id}.question"] = Wanted()
        required |= {f"background.{question.id}.choices.{choice}": Wanted() for choice in question.choices}
    for quizzed in study.quiz.questions if study.quiz else ():
        required[f"quiz.{quizzed.id}.question"] = Wanted()
        required[f"quiz.{quizzed.id}.feedback"] = Wanted()
        required |= {f"quiz.{quizzed.id}.choices.{choice}": Wanted() for choice in quizzed.choices}
    return required | {f"debriefing.{name}": Wanted() for name in study.debriefing.discloses}


def _experiment_texts(experiment: Experiment, texts: Texts) -> dict[str, Wanted]:
    required = {
        f"experiments.{experiment.id}.title": Wanted(frozenset({"position", "num_trials"})),
        f"experiments.{experiment.id}.introduction": Wanted(),
        f"experiments.{experiment.id}.explanation": Wanted(),
    }
    for item in experiment.items:
        own, common = f"items.{item.id}.{experiment.id}", f"items.{item.id}"
        required[common if common in texts and own not in texts else own] = Wanted()
        required[f"scales.{item.id}.low"] = Wanted()
        required[f"scales.{item.id}.high"] = Wanted()
    return required
