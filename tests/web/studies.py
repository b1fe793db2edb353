"""Studies for tests: the shipped one, with everything around its trials that a test asks for."""

import json
from typing import Any

from tests.web.bundles import read_study
from webapp.study.protocol import Study

BACKGROUND = {
    "questions": [
        {"id": "age", "type": "number", "minimum": 16, "maximum": 120},
        {"id": "gender", "type": "choice", "choices": ["woman", "man", "another"]},
        {"id": "robots", "type": "text"},
    ]
}
QUIZ = {
    "questions": [
        {"id": "goal", "choices": ["key", "flag", "door"], "answer": "flag"},
        {"id": "door", "choices": ["nothing", "key", "wait"], "answer": "key"},
    ]
}
RIGHT = {"answer-goal": "flag", "answer-door": "key"}
WRONG = {"answer-goal": "key", "answer-door": "key"}
CHECKS = [
    {"id": "check-a", "experiment": "1", "trial": 1, "answer": 2},
    {"id": "check-b", "experiment": "1", "trial": 1, "answer": 4},
]
PROLIFIC = {
    "service": "prolific",
    "completed": {"code": "DONE1", "link": "https://recruiter.example/done?cc={code}&pid={id}"},
    "screened_out": {"code": "OUT22"},
    "no_consent": {"code": "NO333", "link": "https://recruiter.example/no?cc={code}"},
    "withdrawn": {"code": "LEFT4", "link": "https://recruiter.example/left?cc={code}"},
}


def a_study(**sections: Any) -> Study:  # noqa: ANN401
    """The shipped study with other sections, given as a study file has them; None leaves a section out."""
    tree = read_study().model_dump(mode="json") | sections
    content = {key: value for key, value in tree.items() if value is not None}
    return Study.model_validate_json(json.dumps(content))


def one_experiment(kinds: list[str], num_layouts: int = 1, **settings: Any) -> list[dict[str, Any]]:  # noqa: ANN401
    """A single experiment with these kinds on the first layouts of the paper's Experiment 1."""
    experiment: dict[str, Any] = {
        "id": "1",
        "situation": "current_view",
        "layouts": ["experiment1-a", "experiment1-b", "experiment1-c"][:num_layouts],
        "kinds": kinds,
        "items": [{"id": "likeliness", "without_explanation": True}, {"id": "general"}],
    }
    return [experiment | settings]
