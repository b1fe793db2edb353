import io
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree import ElementTree as ET

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from tests.worlds import LAYOUTS, lay_out
from webapp.simulations.derivation_figure import derivation, draw_derivation
from webapp.simulations.importance import SETTINGS, ImportanceSettings, run
from webapp.simulations.importance_figures import draw_importance
from webapp.simulations.key_door_walks import GET_KEY, OPEN_DOOR, PASS_DOOR, REACH_GOAL, Phase, walk_by_name

ORANGE, BLUE, GREEN = (0xE6, 0x9F, 0x00), (0x00, 0x72, 0xB2), (0x00, 0x9E, 0x73)
THROUGH_TWO_ROOMS = """\
#########
#K..#...#
#...#...#
#.^.D..G#
#########
"""
ROUND_THE_CORNER = lay_out("########", "#>..K..#", "#.######", "#.D...G#", "########")
"""The key lies on the way to nowhere, and the door is behind the agent."""


def settings_of(name: str, trials: int = 300) -> ImportanceSettings:
    packaged = SETTINGS["quick"]
    if name == "simulation":
        layout, believed = packaged.layout, packaged.believed_layout
    else:
        layout, believed = THROUGH_TWO_ROOMS, None
    return ImportanceSettings(layout, name, believed, num_trials=trials, learned=False)


@cache
def rows_of(name: str) -> pd.DataFrame:
    with TemporaryDirectory() as folder:
        return run(settings_of(name), Path(folder), lambda *_: None)


def texts(svg: bytes) -> list[str]:
    """Return what the letters spell, which matplotlib notes above their outlines."""
    parser = ET.XMLParser(target=ET.TreeBuilder(insert_comments=True))  # noqa: S314 - our own file.
    return [str(node.text).strip() for node in ET.fromstring(svg, parser).iter() if callable(node.tag)]  # noqa: S314


def colours(png: bytes) -> set[tuple[int, ...]]:
    return {
        tuple(colour)
        for colour in np.unique(np.asarray(Image.open(io.BytesIO(png)).convert("RGB")).reshape(-1, 3), axis=0).tolist()
    }


def test_events_are_found_where_the_state_changes() -> None:
    names = ["forward", "forward", "pickup", "left", "left", "forward", "forward", "left", "forward", "forward"]
    way = walk_by_name(ROUND_THE_CORNER, [*names, "left", "toggle", *["forward"] * 5])
    steps = [way.event_step(event) for event in (GET_KEY, OPEN_DOOR, PASS_DOOR, REACH_GOAL)]
    assert steps == [3, 12, 14, 17]
    assert way.door_steps == (12, 13, 14)
    assert way.phases == (Phase(GET_KEY, 1, 3), Phase(PASS_DOOR, 4, 14), Phase(REACH_GOAL, 15, 17))
    assert [way.name(step) for step in (2, 3, 12, 13, 14, 17)] == [
        "forward",
        "get key",
        "open door",
        "forward",
        "pass through door",
        "reach goal",
    ]


def test_what_does_not_happen_has_no_step_and_ends_no_phase() -> None:
    way = walk_by_name(LAYOUTS["simulation"], ["forward", "pickup", "toggle"])
    assert [way.event_step(event) for event in (GET_KEY, OPEN_DOOR, PASS_DOOR, REACH_GOAL)] == [None] * 4
    assert way.phases == () == way.door_steps
    assert [way.name(step) for step in (1, 2, 3)] == ["forward", "pickup", "toggle"]


@pytest.mark.parametrize("draw", [draw_importance, draw_derivation])
def test_the_same_rows_give_the_same_bytes_and_other_rows_do_not(
    draw: Callable[[ImportanceSettings, pd.DataFrame], dict[str, bytes]],
) -> None:
    rows = rows_of("simulation")
    files = draw(settings_of("simulation"), rows)
    assert files == draw(settings_of("simulation"), rows.copy())
    assert all(files[name] != again for name, again in draw(settings_of("two rooms"), rows_of("two rooms")).items())


def test_the_importance_figure_names_every_step_its_action_and_what_the_parts_end_with() -> None:
    words = texts(draw_importance(settings_of("simulation"), rows_of("simulation"))["importance.svg"])
    rows = rows_of("simulation").query("importance == 'ace' and estimator == 'exact'")
    labels = [f"{step}  {action}" for step, action in zip(rows["step"][:-1], rows["action"][:-1], strict=True)]
    assert {*labels, "21  target"} <= set(words)
    assert {"get key", "pass through door", "reach goal"} <= set(words)
    assert {"return probability", "average causal effect", "exact", "subgoal", "sampled, 300 trials, 95 %"} <= set(
        words
    )
    assert not any("learned" in word for word in words)


def test_the_figure_fits_a_page_and_tells_the_mean_and_the_samples_apart() -> None:
    png = draw_importance(settings_of("simulation"), rows_of("simulation"))["importance.png"]
    image = Image.open(io.BytesIO(png))
    assert image.width / 200 * 2.54 <= 16.3
    assert {ORANGE, BLUE} <= colours(png)
    assert GREEN not in colours(png)


def test_learned_values_are_drawn_and_named_where_there_are_some() -> None:
    rows = rows_of("simulation")
    learned = rows.assign(estimator=rows["estimator"].map({"exact": "learned exact", "sampled": "learned sampled"}))
    settings = replace(SETTINGS["quick"], learned=True)
    files = draw_importance(settings, pd.concat([rows, learned], ignore_index=True))
    assert {"learned model, exact", "learned model, 200 trials, 95 %"} <= set(texts(files["importance.svg"]))
    assert GREEN in colours(files["importance.png"])


def test_rows_of_another_run_are_refused_by_what_they_lack() -> None:
    rows = rows_of("simulation")
    with pytest.raises(ValueError, match="no exact values of return_probability"):
        draw_importance(settings_of("simulation"), rows[rows["importance"] == "ace"])


def test_the_misunderstood_door_is_explained_with_passing_the_real_one() -> None:
    found = derivation(settings_of("simulation"), rows_of("simulation"))
    assert (found.subgoals, found.key_points) == ((7, 16, 20), (16, 20))


def test_the_derivation_shows_three_panels_and_says_which_key_point_is_the_explanation() -> None:
    words = texts(draw_derivation(settings_of("simulation"), rows_of("simulation"))["derivation.svg"])
    assert [word for word in words if word.startswith("(")] == [
        "(a) optimal path and subgoals",
        "(b) route that the questioner assumes",
        "(c) key points and explanation",
    ]
    assert {"7  get key: on the route, too", "16  pass through door: explanation", "20  reach goal: key point"} <= set(
        words
    )
    assert {"?", "solid: where its actions really lead"} <= set(words)


def test_every_step_of_the_path_is_numbered_on_the_map() -> None:
    words = texts(draw_derivation(settings_of("two rooms"), rows_of("two rooms"))["derivation.svg"])
    num_steps = int(rows_of("two rooms")["step"].max()) - 1
    ends = [word.split("–") for word in words if word.replace("–", "").isdigit()]  # noqa: RUF001 - from, to.
    numbered = {step for first, *last in ends for step in range(int(first), int(last[0] if last else first) + 1)}
    assert numbered == set(range(1, num_steps + 1))


def test_where_nobody_asks_there_is_one_panel() -> None:
    words = texts(draw_derivation(settings_of("two rooms"), rows_of("two rooms"))["derivation.svg"])
    assert [word for word in words if word.startswith("(")] == ["(a) optimal path and subgoals"]
