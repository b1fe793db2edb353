import os
from pathlib import Path

import pytest

from tests.unit.stimuli.study_folders import change, plan_and_build, set_texts, small_study
from webapp.stimuli.catalogue import BundleError, Catalogue
from webapp.stimuli.program import running_program
from webapp.stimuli.publication import (
    MANIFEST,
    changes,
    check_published,
    lock,
    point_at,
    program_of,
    published_bundle,
    unlock,
)
from webapp.stimuli.tables import canonical_json

STUDY = "sakai2021"


@pytest.fixture
def study(tmp_path: Path) -> Path:
    return small_study(tmp_path)


@pytest.fixture
def instance(tmp_path: Path) -> Path:
    return tmp_path / "instance"


@pytest.fixture
def bundle(study: Path, instance: Path) -> Path:
    return instance / "bundles" / plan_and_build(study, instance).catalogue.version


def test_what_was_never_published_is_not_served(bundle: Path, instance: Path) -> None:
    del bundle
    wish = r"study 'sakai2021' is not published in .*; run `xar study publish` with its folder"
    with pytest.raises(BundleError, match=wish):
        check_published(instance, STUDY)


def test_a_published_version_stays_the_served_one_whatever_is_built_afterwards(
    study: Path, bundle: Path, instance: Path
) -> None:
    point_at(instance, STUDY, bundle.name)
    set_texts(study, {"instructions.start": "Ready"})
    assert plan_and_build(study, instance).catalogue.version != bundle.name
    assert check_published(instance, STUDY) == published_bundle(instance, STUDY) == bundle


@pytest.mark.parametrize("content", ["", "nonsense", "../../etc", "é"])
def test_a_pointer_that_names_no_bundle_is_refused(content: str, bundle: Path, instance: Path) -> None:
    (bundle.parent / f"published-{STUDY}").write_text(content, encoding="utf-8")
    with pytest.raises(BundleError, match="publish"):
        published_bundle(instance, STUDY)


def test_other_code_than_that_of_the_published_version_is_refused(bundle: Path, instance: Path) -> None:
    manifest = bundle / MANIFEST
    published = running_program().digest
    manifest.write_text(manifest.read_text("utf-8").replace(published, "f" * 64), "utf-8")
    point_at(instance, STUDY, bundle.name)
    with pytest.raises(BundleError, match=r"was published with program .* \(ffffffffffff\), and this is .*; run `xar"):
        check_published(instance, STUDY)


@pytest.mark.parametrize("content", [{}, {"program": {}}, {"program": 3}, {"program": {"version": "1"}}])
def test_a_bundle_that_does_not_say_whose_it_is_is_refused(content: object, bundle: Path) -> None:
    (bundle / MANIFEST).write_bytes(canonical_json(content))
    with pytest.raises(BundleError, match="does not say which program"):
        program_of(bundle)


def test_nothing_of_a_locked_bundle_may_be_written(bundle: Path) -> None:
    lock(bundle)
    paths = [bundle, *bundle.rglob("*")]
    assert {path.stat().st_mode & 0o777 for path in paths} == {0o444, 0o555}
    assert all(path.is_dir() == (path.stat().st_mode & 0o777 == 0o555) for path in paths)
    Catalogue.open(bundle)
    unlock(bundle)
    assert all(os.access(path, os.W_OK) for path in paths)


def test_a_damaged_published_bundle_is_built_again_although_it_is_locked(
    study: Path, bundle: Path, instance: Path
) -> None:
    picture = next((bundle / "pictures").iterdir())
    whole = picture.read_bytes()
    picture.write_bytes(whole[:-1])
    lock(bundle)
    assert plan_and_build(study, instance).catalogue.version == bundle.name
    assert picture.read_bytes() == whole


def test_what_changed_between_two_versions_is_told_file_by_file(study: Path, bundle: Path, instance: Path) -> None:
    assert changes(bundle, bundle) == ()
    set_texts(study, {"instructions.start": "Ready"})
    change(study / "study.toml", "num_draws = 10", "num_draws = 9")
    (study / "own.py").write_text("", encoding="utf-8")
    after = instance / "bundles" / plan_and_build(study, instance).catalogue.version
    assert changes(bundle, after) == (
        "catalogue.json changed",
        "sources/study/own.py added",
        "sources/study/study.toml changed",
        "sources/study/texts/en.toml changed",
    )


def test_another_map_changes_pictures_and_tables_which_are_counted(study: Path, bundle: Path, instance: Path) -> None:
    change(study / "layouts" / "experiment1-a.txt", "#.>.#..#", "#.<.#..#")
    after = instance / "bundles" / plan_and_build(study, instance).catalogue.version
    told = changes(bundle, after)
    assert "sources/study/layouts/experiment1-a.txt changed" in told
    assert "1 of tables/ changed" in told
    assert not [line for line in told if line.startswith("pictures/")]
