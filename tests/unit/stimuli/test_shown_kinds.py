"""What pages see of the kinds that are not the paper's, of predictions and of drives; the planner's agents."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from tests.unit.stimuli.study_folders import ARMS, TAILORED, plan_and_build, study_of_all_kinds
from tests.worlds import LAYOUTS
from webapp.explainer.pictures.sentences import load_phrases, sentence
from webapp.explainer.worlds.key_door import ACTIONS, key_door_state, tabulate
from webapp.explainer.worlds.view import View, egocentric_view
from webapp.stimuli.catalogue import BundleError, Catalogue, Frame, Strip
from webapp.stimuli.sources import STUDIES
from webapp.study.experiments import Kind
from webapp.study.session import Trial
from webapp.study.texts import MissingTextError

MAX_PICTURE_BYTES = 150_000
"""How much of pictures a participant may have to fetch for one trial."""

PLACES = [
    *(("1", name) for name in ("experiment1-a", "experiment1-b", "experiment1-c")),
    *(("2", name) for name in ("experiment2-a", "experiment2-b")),
]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Catalogue:
    folder = tmp_path_factory.mktemp("all-kinds")
    return plan_and_build(study_of_all_kinds(folder), folder / "instance").catalogue


def trial(place: tuple[str, str], kind: Kind, draw: int | None = None) -> Trial:
    return Trial(place[0], 1, 3, place[1], kind, draw)


def explained(built: Catalogue, one: Trial) -> tuple[Strip, ...]:
    return built.explanation(one, "en", () if one.kind in TAILORED else None)


def num_pictures(strips: tuple[Strip, ...]) -> int:
    return sum(len(strip.frames) for strip in strips)


def all_trials(catalogue: Catalogue) -> Iterator[Trial]:
    for experiment in catalogue.study.experiments:
        for layout in experiment.layouts:
            for kind in experiment.kinds:
                draws = range(catalogue.study.explanation.num_draws) if kind == "random" else [None]
                yield from (trial((experiment.id, layout), kind, draw) for draw in draws)


@pytest.mark.parametrize("place", PLACES)
def test_every_arm_but_none_shows_as_many_pictures_as_the_subgoals(built: Catalogue, place: tuple[str, str]) -> None:
    subgoals = explained(built, trial(place, "tailored_all"))
    for kind in built.study.experiment(place[0]).kinds:
        if kind in ARMS and kind != "none":
            assert num_pictures(explained(built, trial(place, kind))) == num_pictures(subgoals)


@pytest.mark.parametrize("place", PLACES)
def test_no_explanation_shows_the_current_view_alone(built: Catalogue, place: tuple[str, str]) -> None:
    current = built.situation(trial(place, "none"), "en").current
    assert explained(built, trial(place, "none")) == (Strip((current,), ()),)


@pytest.mark.parametrize("place", PLACES)
def test_a_placebo_shows_nothing_but_the_current_view_each_time_by_itself(
    built: Catalogue, place: tuple[str, str]
) -> None:
    strips = explained(built, trial(place, "placebic"))
    assert set(strips) == {Strip((built.situation(trial(place, "placebic"), "en").current,), ())}
    assert len(strips) == num_pictures(explained(built, trial(place, "tailored_all")))


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("kind", ["highlights", "landmarks", "evenly_spaced"])
def test_an_arm_shows_pairs_of_the_path_from_the_current_view_on(
    built: Catalogue, place: tuple[str, str], kind: Kind
) -> None:
    world, from_step = built.world(place[1]), built.from_step(trial(place, kind))
    pairs = [shown_pair(built, place[1], step) for step in range(from_step, world.num_steps + 1)]
    current, *others = explained(built, trial(place, kind))
    assert current.frames == (built.view(place[1], world.path_states[from_step - 1], "en"),)
    remaining = iter(pairs)
    assert all(strip in remaining for strip in others), "the pairs must come in the order of the path"


def shown_pair(built: Catalogue, layout: str, step: int) -> Strip:
    world = built.world(layout)
    after = built.view(layout, world.path_states[step], "en")
    if step == world.num_steps:
        return Strip((after,), ())
    before = built.view(layout, world.path_states[step - 1], "en")
    return Strip((before, after), (built.action_name(world.path_actions[step - 1], "en"),))


@pytest.mark.parametrize("place", PLACES)
def test_a_tailored_explanation_shows_the_key_points_of_the_participants_own_route(
    built: Catalogue, place: tuple[str, str]
) -> None:
    world, from_step = built.world(place[1]), built.from_step(trial(place, "tailored_all"))
    current = Strip((built.situation(trial(place, "tailored_all"), "en").current,), ())
    key, *_ = (step for step in world.subgoals if step >= from_step)
    for route in (["left"], [*world.path_actions[from_step - 1 : key], "left"]):
        missed = world.key_points(from_step, route)
        assert len(missed) == (3 if route == ["left"] else 2)
        pairs = [shown_pair(built, place[1], step) for step in missed]
        assert built.explanation(trial(place, "tailored_all"), "en", missed) == (current, *pairs)
        assert built.explanation(trial(place, "tailored_first"), "en", missed) == (current, pairs[0])


@pytest.mark.parametrize("kind", TAILORED)
@pytest.mark.parametrize("place", PLACES)
def test_whoever_missed_nothing_is_shown_all_the_subgoals(built: Catalogue, place: tuple[str, str], kind: Kind) -> None:
    world, from_step = built.world(place[1]), built.from_step(trial(place, kind))
    _, *pairs = built.explanation(trial(place, kind), "en", [])
    assert pairs == [shown_pair(built, place[1], step) for step in world.subgoals if step >= from_step]


def test_key_points_that_do_not_belong_are_refused(built: Catalogue) -> None:
    place = ("2", "experiment2-a")
    with pytest.raises(ValueError, match="key points belong to a tailored kind and to no other, and this is 'none'"):
        built.explanation(trial(place, "none"), "en", (8,))
    with pytest.raises(ValueError, match="and this is 'tailored_all'"):
        built.explanation(trial(place, "tailored_all"), "en")
    for step in (1, 9):
        with pytest.raises(KeyError):
            built.explanation(trial(place, "tailored_all"), "en", (step,))


@pytest.mark.parametrize("place", PLACES)
def test_the_explanation_begins_at_the_step_where_the_video_ends(built: Catalogue, place: tuple[str, str]) -> None:
    one = trial(place, "none")
    video = built.situation(one, "en").video
    assert built.from_step(one) == (1 if video is None else len(video.frames))


@pytest.mark.parametrize("layout", sorted(LAYOUTS))
def test_every_state_has_the_picture_and_the_words_of_its_view(built: Catalogue, layout: str) -> None:
    world = tabulate(LAYOUTS[layout])
    shown: dict[View, Frame] = {}
    for state in range(built.world(layout).num_states):
        frame = built.view(layout, state, "en")
        assert built.picture(frame.digest) is not None
        assert shown.setdefault(egocentric_view(LAYOUTS[layout], key_door_state(world, state)), frame) == frame
    assert len({frame.alt for frame in shown.values()}) == len(shown)


@pytest.mark.parametrize("layout", sorted(LAYOUTS))
def test_each_step_of_the_path_is_told_in_words(built: Catalogue, layout: str) -> None:
    world, phrases = built.world(layout), load_phrases("en")
    states = [key_door_state(tabulate(LAYOUTS[layout]), state) for state in world.path_states]
    told = built.sentences(layout, "en")
    assert list(told) == list(range(1, world.num_steps + 1))
    for step, text in told.items():
        action = ACTIONS.index(world.path_actions[step - 1])
        assert text == sentence(LAYOUTS[layout], states[step - 1], action, step, phrases)


@pytest.mark.parametrize("place", PLACES)
def test_the_predictions_asked_for_have_the_agents_answer(built: Catalogue, place: tuple[str, str]) -> None:
    world = built.world(place[1])
    questions = built.probes(*place)
    assert len({question.state for question in questions}) == 3
    for question in questions:
        assert question.action == world.policy_action(question.state)
        assert (question.state in world.path_states) == (place[0] == "2")
        best = world.optimum(question.state)
        assert best is not None
        after = {action: world.optimum(world.next_state(question.state, action)) for action in world.actions}
        assert question.as_good == tuple(action for action, left in after.items() if left == best - 1)


def test_a_study_that_asks_for_no_prediction_has_none(bundle: Catalogue) -> None:
    assert {bundle.probes(*place) for place in PLACES} == {()}


def test_an_action_is_named_by_its_number_or_its_name(built: Catalogue) -> None:
    texts = built.texts("en")
    for number, name in enumerate(ACTIONS):
        assert built.action_name(number, "en") == built.action_name(name, "en") == texts(f"actions.{name}")
    with pytest.raises(MissingTextError, match="jump"):
        built.action_name("jump", "en")


def test_a_world_is_read_once_however_many_ask_at_the_same_time(built: Catalogue) -> None:
    again = Catalogue.open(built.folder)
    with ThreadPoolExecutor(8) as pool:
        found = set(pool.map(lambda _: id(again.world("simulation")), range(64)))
    assert len(found) == 1


@pytest.mark.parametrize("layout", ["nowhere", "../catalogue", ""])
def test_a_layout_that_the_study_does_not_have_is_refused(built: Catalogue, layout: str) -> None:
    with pytest.raises(KeyError):
        built.world(layout)


def test_a_table_that_vanished_after_the_start_is_told(tmp_path: Path) -> None:
    catalogue = plan_and_build(study_of_all_kinds(tmp_path), tmp_path / "instance").catalogue
    (catalogue.folder / "tables" / "simulation.json").unlink()
    assert catalogue.world("experiment1-a").start == 0
    with pytest.raises(BundleError, match=r"is damaged .* build it again"):
        catalogue.world("simulation")


@pytest.mark.parametrize("name", [file.parent.name for file in sorted(STUDIES.glob("*/study.toml"))])
def test_a_shipped_study_can_be_built_and_needs_few_pictures_in_each_trial(name: str, tmp_path: Path) -> None:
    assert_few_pictures(plan_and_build(STUDIES / name, tmp_path).catalogue)


def test_no_kind_needs_more_pictures_than_a_slow_connection_carries(built: Catalogue) -> None:
    assert_few_pictures(built)


def assert_few_pictures(catalogue: Catalogue) -> None:
    """Add up situation and explanation of each trial; a picture that is shown twice is fetched once."""
    sizes = {}
    for one in all_trials(catalogue):
        situation = catalogue.situation(one, "en")
        strips = [situation.video, *explained(catalogue, one)]
        frames = {situation.current, *(frame for strip in strips if strip for frame in strip.frames)}
        pictures = [catalogue.picture(frame.digest) for frame in frames]
        sizes[one.layout, one.kind, one.draw] = sum(len(picture.content) for picture in pictures if picture is not None)
    largest = sorted(sizes.items(), key=lambda each: -each[1])[:5]
    assert max(sizes.values()) <= MAX_PICTURE_BYTES, f"the largest, in bytes: {largest}"
