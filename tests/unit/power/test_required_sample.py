from dataclasses import replace
from pathlib import Path

import pytest

from tests.unit.power.designs import study_and_plan
from webapp.study.analysis_plan import Contrast
from webapp.study.required_sample import (
    RequiredSample,
    RequiredSamples,
    design_digest,
    read_required,
    write_required,
)

STUDY, PLAN = study_and_plan()
FOUND = RequiredSamples(0.8, 300, 400, (RequiredSample(0.2, None), RequiredSample(0.5, 74), RequiredSample(1.0, 30)))


def test_what_was_written_is_read_and_told(tmp_path: Path) -> None:
    assert read_required(tmp_path, "a") is None
    write_required(tmp_path, "a", replace(FOUND, num_studies=9))
    path = write_required(tmp_path, "a", FOUND)
    assert read_required(tmp_path, "a") == FOUND
    assert [file.name for file in path.parent.iterdir()] == ["a.json"]
    assert str(FOUND) == (
        "Required participants: more than 400 for d = .2, 74 for d = .5, 30 for d = 1 "
        "(power .8; xar power, 300 simulated studies)."
    )


@pytest.mark.parametrize("content", ["", "[]", '{"power": 0.8}', '{"samples": 3, "power": 1}', '{"samples": [{}]}'])
def test_a_file_that_cannot_be_read_is_no_file(tmp_path: Path, content: str) -> None:
    write_required(tmp_path, "a", FOUND).write_text(content, encoding="utf-8")
    assert read_required(tmp_path, "a") is None


def test_the_digest_covers_design_and_plan() -> None:
    first, second = STUDY.experiments
    reordered = first.model_copy(update={"kinds": first.kinds[::-1]})
    finer = first.model_copy(update={"items": (first.items[0].model_copy(update={"points": 7}), *first.items[1:])})
    moved = first.model_copy(update={"layout_order": "counterbalanced"})
    designs = [STUDY.model_copy(update={"experiments": (each, second)}) for each in (reordered, finer, moved)]
    plans = [
        replace(PLAN, alpha=0.01),
        replace(PLAN, items={"1": ("general",), "2": ("general",)}),
        replace(PLAN, contrasts=(*PLAN.contrasts, Contrast("1", "full", "random"))),
    ]
    digests = [design_digest(STUDY, PLAN), *(design_digest(each, PLAN) for each in designs)]
    digests += [design_digest(STUDY, each) for each in plans]
    assert len(set(digests)) == len(digests)


def test_the_digest_covers_no_wording_and_no_address() -> None:
    renamed = STUDY.model_copy(update={"contact": "office@example.org", "consent_version": "3", "languages": ("en",)})
    assert design_digest(renamed, replace(PLAN, text="in words")) == design_digest(STUDY, PLAN)
