from pathlib import Path

import pytest

from tests.unit.stimuli.study_folders import change, copy_study, plan_and_build, study_of_all_kinds
from webapp.stimuli.catalogue import Catalogue
from webapp.stimuli.duration import SECONDS_PER_ANSWER, SECONDS_PER_PAGE, expected_duration, full_round
from webapp.stimuli.sources import STUDIES
from webapp.study.protocol import parse_study


def test_the_papers_study_takes_about_as_long_as_its_welcome_says(bundle: Catalogue) -> None:
    duration = expected_duration(bundle)
    assert 6 < duration.shortest <= duration.median <= duration.longest < 12


def test_each_item_more_takes_the_time_of_an_answer_in_each_trial(tmp_path: Path, bundle: Catalogue) -> None:
    study = copy_study(tmp_path)
    text = (study / "study.toml").read_text("utf-8")
    item = '[[experiments.items]]\nid = "general"\npoints = 5\n'
    first, _, rest = text.partition(item)
    (study / "study.toml").write_text(first + rest, encoding="utf-8")
    fewer = expected_duration(plan_and_build(study, tmp_path / "instance").catalogue)
    whole = expected_duration(bundle)
    words_once = 5 / 60  # The item is read once too.
    assert 60 * (whole.median - fewer.median) == pytest.approx(3 * SECONDS_PER_ANSWER, abs=60 * words_once)


def test_drives_and_predictions_take_time(tmp_path: Path, bundle: Catalogue) -> None:
    everything = plan_and_build(study_of_all_kinds(tmp_path), tmp_path / "instance").catalogue
    more = expected_duration(everything)
    assert more.median > expected_duration(bundle).median + 5 * 2 * SECONDS_PER_PAGE / 60
    assert more.longest - more.shortest > 1 / 60


def test_a_counterbalanced_order_asks_for_more_participants_in_a_round(tmp_path: Path) -> None:
    study = copy_study(tmp_path)
    text = (study / "study.toml").read_text("utf-8")
    assert full_round(parse_study(text)) == 6
    change(study / "study.toml", 'id = "1"\nsituation', 'id = "1"\nlayout_order = "counterbalanced"\nsituation')
    assert full_round(parse_study((study / "study.toml").read_text("utf-8"))) == 36
    assert full_round(parse_study((STUDIES / "understanding" / "study.toml").read_text("utf-8"))) == 36
