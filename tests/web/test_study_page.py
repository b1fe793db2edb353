"""What the dashboard says of a study's settings."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from flask import Flask

from tests.web.bundles import read_study, write_bundle
from tests.web.researchers import researcher_of
from webapp.config import Config
from webapp.study.sections import AnalysisPlan


@pytest.mark.parametrize(
    ("analysis", "told"),
    [
        (None, "none is frozen with the study"),
        (AnalysisPlan(), "none is frozen with the study"),
        (AnalysisPlan(plan="plan.md"), "<code>plan.md</code>, frozen with the version"),
    ],
)
def test_only_a_plan_that_there_is_is_named(
    instance: Path, start_app: Callable[[Config], Flask], analysis: AnalysisPlan | None, told: str
) -> None:
    study = read_study().model_copy(update={"analysis": analysis})
    write_bundle(instance, study)
    page = researcher_of(start_app(Config(instance, study=study.name))).get("/researcher/study").text
    found = re.search(r"<dt>Planned analysis</dt><dd>(.*?)</dd>", page)
    assert found is not None
    assert found[1] == told
