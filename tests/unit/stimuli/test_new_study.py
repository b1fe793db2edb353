import re
import tomllib
import typing
from collections.abc import Iterator
from datetime import date
from pathlib import Path

import pytest
from pydantic import BaseModel

from tests.unit.stimuli.study_folders import files_of
from webapp.stimuli.checking import check_study
from webapp.stimuli.new_study import TEMPLATES, write_study
from webapp.stimuli.sources import STUDIES
from webapp.study.problems import StudyError
from webapp.study.protocol import Study, parse_study


@pytest.mark.parametrize("template", TEMPLATES)
def test_a_new_study_passes_the_check_at_once(template: str, tmp_path: Path) -> None:
    folder = write_study("my-study", template, tmp_path / "studies")
    assert folder == tmp_path / "studies" / "my-study"
    assert check_study(folder, tmp_path / "instance", date(2026, 11, 27)).study.name == "my-study"


@pytest.mark.parametrize("template", TEMPLATES)
def test_a_new_study_is_the_shipped_one_with_another_name_and_all_its_comments(template: str, tmp_path: Path) -> None:
    written, shipped = files_of(write_study("mine", template, tmp_path)), files_of(STUDIES / template)
    assert written.keys() == shipped.keys()
    assert {name for name in written if written[name] != shipped[name]} == {"study.toml"}
    text = written["study.toml"].decode()
    assert text.startswith(f"# Copied from the study {template} by `xar study new`.")
    assert text.replace('name = "mine"', f'name = "{template}"', 1).endswith(shipped["study.toml"].decode())


@pytest.mark.parametrize("template", TEMPLATES)
def test_every_setting_that_there_is_stands_in_the_written_file_used_or_as_a_comment(
    template: str, tmp_path: Path
) -> None:
    text = (write_study("mine", template, tmp_path) / "study.toml").read_text(encoding="utf-8")
    missing = [name for name in sorted(set(_settings(Study))) if not re.search(rf"(?<![\w-]){name}(?![\w-])", text)]
    assert missing == []


def test_every_section_that_the_papers_study_leaves_out_can_be_taken_in(tmp_path: Path) -> None:
    text = (write_study("mine", "sakai2021", tmp_path) / "study.toml").read_text(encoding="utf-8")
    used, _, left_out = text.partition("# What follows is not used here.")
    sections = _uncommented(left_out)
    tree = tomllib.loads(sections)
    assert {"quality", "background", "practice", "quiz", "recruitment", "kinds", "worlds"} <= tree.keys()
    without_worlds = re.sub(r"\[worlds\.lake\].*?(?=\n\[)", "", sections, flags=re.DOTALL)
    study = parse_study(used.replace("# quota = 60", "quota = 60") + without_worlds)
    assert (study.quota, len(study.experiments), len(study.attention_checks)) == (60, 3, 2)
    lake = re.findall(r"\[worlds\.lake\].*?(?=\n\[)", sections, flags=re.DOTALL)
    named = used.replace('"simulation",', '"simulation", "lake",').replace("\n[ask]\n", "\n")
    assert parse_study(named + lake[0]).worlds["lake"].actions == ("left", "down", "right", "up")


@pytest.mark.parametrize("template", TEMPLATES)
def test_what_the_planned_analysis_leaves_out_can_be_taken_in(template: str, tmp_path: Path) -> None:
    text = (write_study("mine", template, tmp_path) / "study.toml").read_text(encoding="utf-8")
    settings = r"^# (?=(equivalences|equivalence_margin|alpha|items|plan) = )"
    before, analysis, after = re.split(r"(\[analysis\].*?\n\n)", text, maxsplit=1, flags=re.DOTALL)
    declared = parse_study(f"{before}{re.sub(settings, '', analysis, flags=re.MULTILINE)}{after}").analysis
    assert declared is not None
    left_out = parse_study(text)
    assert (declared.plan, declared.alpha, declared.equivalence_margin) == ("analysis_plan.md", 0.05, 0.5)
    assert declared.items == tuple(item.id for item in left_out.experiments[0].items)
    assert declared.equivalences
    assert left_out.analysis is not None
    assert (left_out.analysis.plan, left_out.analysis.items) == (None, ())


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    write_study("mine", "sakai2021", tmp_path)
    before = files_of(tmp_path)
    with pytest.raises(StudyError, match=r"mine is there already; choose another name, or another folder with --into"):
        write_study("mine", "understanding", tmp_path)
    assert files_of(tmp_path) == before


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("My Study", "a study cannot be called 'My Study'; use up to 64 lower-case letters"),
        ("../mine", "a study cannot be called '../mine'; use up to 64 lower-case letters"),
        ("", "a study cannot be called ''; use up to 64 lower-case letters"),
        ("sakai2021", "a study cannot be called 'sakai2021', which comes with the program; choose another name"),
        ("texts", "a study cannot be called 'texts', which comes with the program; choose another name"),
    ],
)
def test_a_name_that_cannot_be_used_writes_nothing(name: str, problem: str, tmp_path: Path) -> None:
    with pytest.raises(StudyError) as error:
        write_study(name, "sakai2021", tmp_path / "studies")
    assert str(error.value).startswith(problem)
    assert not (tmp_path / "studies").exists()


def test_a_place_that_is_no_folder_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(StudyError, match="file is a file; name a folder with --into"):
        write_study("mine", "sakai2021", tmp_path / "file")


def _settings(model: type[BaseModel]) -> Iterator[str]:
    for name, field in model.model_fields.items():
        yield name
        for part in _models(field.annotation):
            yield from _settings(part)


def _models(annotation: object) -> Iterator[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in typing.get_args(annotation):
        yield from _models(argument)


def _uncommented(text: str) -> str:
    """Take the comment signs away from the lines of each commented-out section, which ends with a line without one."""
    lines, is_inside = [], False
    for line in text.splitlines():
        is_inside = line.startswith("# [") or (is_inside and line.startswith("#"))
        if is_inside:
            lines.append(line.removeprefix("#").removeprefix(" "))
    return "\n".join(lines)
