import json
from collections.abc import Mapping
from pathlib import Path

import pytest

from tests.unit.stimuli.study_folders import change, files_of, plan_and_build, quietly, small_study
from webapp.stimuli.build import build
from webapp.stimuli.catalogue import BundleError
from webapp.stimuli.verification import Part, Verified, verify


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    version = plan_and_build(small_study(tmp_path), tmp_path / "instance").catalogue.version
    return tmp_path / "instance" / "bundles" / version


def check(bundle: Path) -> Verified:
    return verify(bundle, "stored", quietly)


def by_name(found: Verified) -> Mapping[str, Part]:
    return {part.name: part for part in found.parts}


def test_a_bundle_is_reproduced_to_the_byte_from_its_own_files_and_is_not_touched(bundle: Path) -> None:
    before = files_of(bundle)
    found = check(bundle)
    assert (found.is_proven, found.is_whole, found.version, found.notes) == (True, True, bundle.name, ())
    parts = by_name(found)
    assert parts["pictures"].num_files == len(list((bundle / "pictures").iterdir())) > 10
    assert all(part.num_reproduced == part.num_files and not part.differences for part in found.parts)
    assert files_of(bundle) == before


def test_the_study_that_it_was_built_from_is_not_needed(tmp_path: Path, bundle: Path) -> None:
    (tmp_path / "studies" / "sakai2021" / "study.toml").unlink()
    assert check(bundle).is_proven


def test_a_changed_byte_of_a_picture_is_found(bundle: Path) -> None:
    picture = sorted((bundle / "pictures").iterdir())[3]
    content = bytearray(picture.read_bytes())
    content[100] ^= 1
    picture.write_bytes(content)
    found = check(bundle)
    assert (found.is_proven, found.is_whole) == (False, False)
    pictures = by_name(found)["pictures"]
    assert pictures.differences == (f"pictures/{picture.name}",)
    assert pictures.num_reproduced == pictures.num_files - 1


def test_a_missing_and_an_added_picture_are_found(bundle: Path) -> None:
    first, second = sorted((bundle / "pictures").iterdir())[:2]
    added = bundle / "pictures" / f"{'0' * 64}.png"
    added.write_bytes(second.read_bytes())
    first.unlink()
    assert by_name(check(bundle))["pictures"].differences == (f"pictures/{added.name}", f"pictures/{first.name}")


def test_a_changed_text_is_found_where_it_is_shown(bundle: Path) -> None:
    catalogue = json.loads((bundle / "catalogue.json").read_text("utf-8"))
    catalogue["texts"]["en"]["items.general"] = "Is this explanation not excellent?"
    (bundle / "catalogue.json").write_text(json.dumps(catalogue), "utf-8")
    found = check(bundle)
    assert (found.is_proven, by_name(found)["catalogue"].differences) == (False, ("catalogue.json",))


def test_a_changed_source_is_found_by_what_comes_out_of_it(bundle: Path) -> None:
    change(
        bundle / "sources" / "study" / "texts" / "en.toml",
        '[situation]\ncontinue = "',
        '[situation]\ncontinue = "Now: ',
    )
    found = check(bundle)
    assert (found.is_proven, found.is_whole) == (False, False)
    assert by_name(found)["catalogue"].differences == ("catalogue.json",)


def test_a_changed_world_is_found(bundle: Path) -> None:
    table = bundle / "tables" / "experiment1-a.json"
    table.write_bytes(table.read_bytes().replace(b'"start":', b'"stort":'))
    assert by_name(check(bundle))["tables"].differences == ("tables/experiment1-a.json",)


def test_sources_that_give_no_study_any_more_prove_nothing(bundle: Path) -> None:
    change(bundle / "sources" / "study" / "study.toml", "num_draws = 10", "num_draws = 0")
    found = check(bundle)
    assert (found.is_proven, found.parts) == (False, ())
    assert "it cannot be built again: " in found.notes[0]
    assert "explanation.num_draws: is 0; use 1 or more" in found.notes[0]


def test_what_is_no_bundle_cannot_be_verified(tmp_path: Path) -> None:
    with pytest.raises(BundleError, match="is no study bundle"):
        check(tmp_path)


def test_other_packages_and_another_program_are_told(bundle: Path) -> None:
    manifest = json.loads((bundle / "manifest.json").read_text("utf-8"))
    manifest["program"]["digest"] = "e" * 64
    manifest["made_with"]["packages"] |= {"pillow": "1.0", "gone": "2.0"}
    (bundle / "manifest.json").write_text(json.dumps(manifest), "utf-8")
    notes = check(bundle).notes
    assert "(eeeeeeeeeeee)" in notes[0]
    assert "gone: 2.0 then, None now" in notes
    assert any(note.startswith("pillow: 1.0 then, ") for note in notes)


@pytest.mark.slow
def test_what_learned_agents_show_is_reproduced_from_their_weights_and_by_training_again(tmp_path: Path) -> None:
    study, instance = small_study(tmp_path), tmp_path / "instance"
    bundle = instance / "bundles" / build(study, instance, quietly).catalogue.version
    stored, trained = verify(bundle, "stored", quietly), verify(bundle, "train", quietly)
    assert (stored.is_proven, trained.is_proven) == (True, True)
    assert (by_name(stored)["weights"].is_compared, by_name(trained)["weights"].is_compared) == (False, True)
    assert by_name(trained)["weights"].num_reproduced == 1
    (bundle / "weights.safetensors").write_bytes(b"nothing")
    damaged = verify(bundle, "stored", quietly)
    assert (damaged.is_proven, damaged.is_whole) == (False, False)
    assert "cannot be used" in damaged.notes[0]
