"""The bundle as pages see it; the shipped study with the planner in the learned agents' place."""

import hashlib
import json
import os
import random
import shutil
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.worlds import LAYOUTS
from webapp.explainer.explanation import kind_strips
from webapp.explainer.solvers import Trajectory
from webapp.explainer.worlds.key_door import ACTIONS, KeyDoorState
from webapp.explainer.worlds.view import egocentric_view, key_in_view
from webapp.stimuli.catalogue import BundleError, Catalogue, Frame, Strip, bundle_version, current_bundle
from webapp.stimuli.picture_files import PictureFiles
from webapp.study.protocol import Kind
from webapp.study.session import Trial

SETTLED_S = 1.1
"""After so long a file that was written is known by how it looks."""

GOLDEN = json.loads((Path(__file__).parents[2] / "golden" / "method-numbers.json").read_text(encoding="utf-8"))


def trial(layout: str, kind: Kind, draw: int | None = None) -> Trial:
    experiment = layout.removeprefix("experiment")[0]
    return Trial(experiment, 1, 3, layout, kind, draw)


def trials(bundle: Catalogue) -> Iterator[Trial]:
    for experiment in bundle.study.experiments:
        for layout in experiment.layouts:
            for kind in experiment.kinds:
                draws = range(bundle.study.explanation.num_draws) if kind == "random" else [None]
                yield from (trial(layout, kind, draw) for draw in draws)


class Shown:
    """What the golden numbers say should be shown of a layout."""

    def __init__(self, bundle: Catalogue, layout: str) -> None:
        states = [KeyDoorState(*state) for state in GOLDEN[layout]["states"]]
        tables = json.loads((bundle.folder / "tables" / f"{layout}.json").read_text(encoding="utf-8"))
        numbers = {tuple(state): n for state, n in zip(tables["states"], tables["pictures"], strict=True)}
        self.states = states
        self.digests = [bundle.digests[numbers[tuple(state)]] for state in states]
        self.words = [bundle.texts("en")(f"actions.{action}") for action in GOLDEN[layout]["actions"]]
        self.subgoals: list[int] = GOLDEN[layout]["return_probability"]["10"]["subgoal_steps"]

    def pair(self, step: int) -> tuple[list[str], list[str]]:
        if step == len(self.words):
            return [self.digests[-1]], []
        return self.digests[step - 1 : step + 1], [self.words[step - 1]]


def plain(strips: tuple[Strip, ...]) -> list[tuple[list[str], list[str]]]:
    return [([frame.digest for frame in strip.frames], list(strip.actions)) for strip in strips]


@pytest.mark.parametrize("layout", ["experiment1-a", "experiment1-b", "experiment1-c"])
def test_the_first_experiment_shows_the_start_and_explains_from_there(bundle: Catalogue, layout: str) -> None:
    shown = Shown(bundle, layout)
    situation = bundle.situation(trial(layout, "full"), "en")
    assert (situation.current.digest, situation.video, situation.announced) == (shown.digests[0], None, ())
    assert plain(bundle.explanation(trial(layout, "full"), "en")) == [(shown.digests, shown.words)]
    subgoals = [([shown.digests[0]], []), *(shown.pair(step) for step in shown.subgoals)]
    assert plain(bundle.explanation(trial(layout, "subgoals"), "en")) == subgoals


@pytest.mark.parametrize("layout", ["experiment1-a", "experiment1-b", "experiment1-c"])
def test_the_random_kind_shows_as_many_pairs_of_the_path_as_there_are_subgoals(bundle: Catalogue, layout: str) -> None:
    shown = Shown(bundle, layout)
    pairs = [shown.pair(step) for step in range(1, len(shown.words) + 1)]
    drawn = []
    for draw in range(10):
        first, *others = plain(bundle.explanation(trial(layout, "random", draw), "en"))
        assert first == ([shown.digests[0]], [])
        assert len(others) == len(shown.subgoals)
        remaining = iter(pairs)
        assert all(pair in remaining for pair in others), "the pairs must come in the order of the path"
        drawn.append(str(others))
    assert max(Counter(drawn).values()) <= 3


@pytest.mark.parametrize("layout", ["experiment2-a", "experiment2-b"])
def test_the_second_experiment_shows_the_way_to_the_split_and_the_key_points(bundle: Catalogue, layout: str) -> None:
    shown, query = Shown(bundle, layout), GOLDEN[layout]["query"]
    split = query["from_step"]
    situation = bundle.situation(trial(layout, "all_key_points"), "en")
    assert situation.video is not None
    assert plain((situation.video,)) == [(shown.digests[:split], shown.words[: split - 1])]
    assert situation.current == situation.video.frames[-1]
    texts = bundle.texts("en")
    assert situation.announced == tuple(texts(f"actions.{action}") for action in query["announced_actions"])
    assert not any(key_in_view(LAYOUTS[layout], state) for state in shown.states[:split])
    key_points = [shown.pair(step) for step in query["key_point_steps"]]
    now: tuple[list[str], list[str]] = ([shown.digests[split - 1]], [])
    assert plain(bundle.explanation(trial(layout, "all_key_points"), "en")) == [now, *key_points]
    assert plain(bundle.explanation(trial(layout, "first_key_point"), "en")) == [now, key_points[0]]


def test_steps_asked_for_are_shown_as_an_explanation_shows_them(bundle: Catalogue) -> None:
    for layout in ("experiment1-a", "experiment1-b", "experiment1-c"):
        for language in bundle.study.languages:
            shown = bundle.strips_of(layout, bundle.world(layout).subgoals, language)
            assert shown == bundle.explanation(trial(layout, "subgoals"), language)
    for layout in ("experiment2-a", "experiment2-b"):
        one = trial(layout, "all_key_points")
        ahead = GOLDEN[layout]["query"]["key_point_steps"]
        assert bundle.strips_of(layout, ahead, "en", bundle.from_step(one)) == bundle.explanation(one, "en")


@pytest.mark.parametrize("layout", sorted(LAYOUTS))
def test_any_steps_of_a_layout_can_be_shown_whether_or_not_an_experiment_has_it(bundle: Catalogue, layout: str) -> None:
    table = json.loads((bundle.folder / "tables" / f"{layout}.json").read_text(encoding="utf-8"))
    path = Trajectory(tuple(table["path"]["states"]), tuple(table["path"]["actions"]))
    texts, rng = bundle.texts("ja"), random.Random(layout)
    for _ in range(30):
        from_step = rng.randint(1, path.num_steps)
        ahead = range(from_step, path.num_steps + 1)
        steps = sorted(rng.sample(ahead, rng.randint(0, len(ahead))))
        wanted = [
            (
                [bundle.digests[table["pictures"][state]] for state in strip.states],
                [texts(f"actions.{ACTIONS[action]}") for action in strip.actions],
            )
            for strip in kind_strips("subgoals", path, steps, from_step)
        ]
        assert plain(bundle.strips_of(layout, steps, "ja", from_step)) == wanted


@pytest.mark.parametrize(("steps", "from_step"), [((0,), 1), ((21,), 1), ((5, 5), 1), ((6, 5), 1), ((4,), 5), ((), 0)])
def test_steps_that_are_not_on_the_way_or_do_not_ascend_are_not_shown(
    bundle: Catalogue, steps: tuple[int, ...], from_step: int
) -> None:
    with pytest.raises(ValueError, match=r"steps ascend from|there is no step 0"):
        bundle.strips_of("simulation", steps, "en", from_step)


def test_a_subgoal_explanation_has_six_or_seven_pictures(bundle: Catalogue) -> None:
    for layout in bundle.study.experiments[0].layouts:
        strips = bundle.explanation(trial(layout, "subgoals"), "en")
        assert sum(len(strip.frames) for strip in strips) in (6, 7)


def test_every_explanation_begins_with_the_current_view(bundle: Catalogue) -> None:
    for one in trials(bundle):
        assert bundle.explanation(one, "en")[0].frames[0] == bundle.situation(one, "en").current


def test_every_picture_shown_is_there_and_is_named_by_its_content(bundle: Catalogue) -> None:
    for one in trials(bundle):
        for strip in bundle.explanation(one, "en"):
            for frame in strip.frames:
                picture = bundle.picture(frame.digest)
                assert picture is not None
                assert picture.content.startswith(b"\x89PNG")


def test_different_pictures_have_different_words_and_each_picture_one(bundle: Catalogue) -> None:
    frames: set[Frame] = {
        frame for one in trials(bundle) for strip in bundle.explanation(one, "en") for frame in strip.frames
    }
    assert len({frame.digest for frame in frames}) == len({frame.alt for frame in frames}) == len(frames)


def test_the_words_of_a_picture_say_what_the_state_looks_like(bundle: Catalogue) -> None:
    shown = Shown(bundle, "experiment1-a")
    (strip,) = bundle.explanation(trial("experiment1-a", "full"), "en")
    for state, frame in zip(shown.states, strip.frames, strict=True):
        view = egocentric_view(LAYOUTS["experiment1-a"], state)
        assert ("holds the key" in frame.alt) == bool(state.has_key) == view.has_key
        assert ("yellow key" in frame.alt) == key_in_view(LAYOUTS["experiment1-a"], state)
    assert [frame.alt for frame in strip.frames][-1].count("stands on the green goal") == 1


def test_the_pictures_are_drawn_for_screens_of_double_density(bundle: Catalogue) -> None:
    picture = bundle.picture(bundle.digests[0])
    assert picture is not None
    header = picture.content[16:24]
    assert (int.from_bytes(header[:4], "big"), int.from_bytes(header[4:], "big")) == (576, 576)


@pytest.mark.parametrize("digest", ["", "../manifest", "0" * 64, "../../current-sakai2021", "A" * 64])
def test_only_the_bundles_own_pictures_are_found(bundle: Catalogue, digest: str) -> None:
    assert bundle.picture(digest) is None


def test_what_the_study_does_not_have_is_refused(bundle: Catalogue) -> None:
    with pytest.raises(KeyError):
        bundle.situation(Trial("3", 1, 1, "experiment1-a", "full", None), "en")
    with pytest.raises(KeyError):
        bundle.explanation(Trial("1", 1, 3, "simulation", "full", None), "en")
    with pytest.raises(KeyError):
        bundle.explanation(trial("experiment1-a", "all_key_points"), "en")
    with pytest.raises(IndexError):
        bundle.explanation(trial("experiment1-a", "random", 10), "en")
    with pytest.raises(KeyError):
        bundle.texts("xx")
    with pytest.raises(KeyError):
        bundle.strips_of("elsewhere", (), "en")


def test_all_actions_have_words(bundle: Catalogue) -> None:
    texts = bundle.texts("en")
    assert len({texts(f"actions.{action}") for action in ACTIONS}) == len(ACTIONS)


@pytest.fixture
def copied(planned_instance: Path, tmp_path: Path) -> Path:
    """A bundle of one's own, to be damaged."""
    return Path(shutil.copytree(planned_instance, tmp_path / "instance")) / "bundles"


def test_a_bundle_that_was_changed_is_refused(copied: Path) -> None:
    folder = current_bundle(copied.parent, "sakai2021")
    Catalogue.open(folder)
    manifest = folder / "manifest.json"
    manifest.write_bytes(manifest.read_bytes() + b" ")
    with pytest.raises(BundleError, match=r"is damaged: its content gives [0-9a-f]{64}; build it again"):
        Catalogue.open(folder)


def flip(file: Path) -> None:
    """Change one bit of a file, and nothing about it that `ls` shows."""
    before = file.stat()
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)
    os.utime(file, ns=(before.st_atime_ns, before.st_mtime_ns))


@pytest.mark.parametrize("was_sent", [True, False])
def test_a_picture_that_was_changed_or_went_under_an_open_bundle_is_not_given(copied: Path, *, was_sent: bool) -> None:
    folder = current_bundle(copied.parent, "sakai2021")
    opened = Catalogue.open(folder)
    first, second, *_ = opened.digests
    if was_sent:
        time.sleep(SETTLED_S)
        assert opened.picture(first) == opened.picture(first)
    flip(folder / "pictures" / f"{first}.png")
    (folder / "pictures" / f"{second}.png").unlink()
    for digest, how in ((first, rf"\(pictures/{first}\.png was changed\)"), (second, "No such file")):
        with pytest.raises(BundleError, match=rf"is damaged .*{how}.*build it again"):
            opened.picture(digest)


def test_a_picture_is_hashed_once_for_each_state_of_its_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    digest = hashlib.sha256(b"picture").hexdigest()
    (tmp_path / f"{digest}.png").write_bytes(b"picture")
    pictures = PictureFiles(tmp_path)
    time.sleep(SETTLED_S)
    first = pictures.read(digest)
    with monkeypatch.context() as nothing_can_be_hashed:
        nothing_can_be_hashed.setattr(hashlib, "sha256", None)
        assert pictures.read(digest) == first
    (tmp_path / f"{digest}.png").write_bytes(b"another")
    with pytest.raises(ValueError, match="was changed"):
        pictures.read(digest)


def test_a_world_that_was_changed_or_went_after_the_bundle_was_opened_is_not_read(copied: Path) -> None:
    folder = current_bundle(copied.parent, "sakai2021")
    opened = Catalogue.open(folder)
    first, second, third, *_ = opened.study.layouts
    known = opened.world(third)
    flip(folder / "tables" / f"{first}.json")
    (folder / "tables" / f"{second}.json").unlink()
    (folder / "tables" / f"{third}.json").unlink()
    for layout, how in ((first, rf"tables/{first}\.json was changed since"), (second, "No such file")):
        with pytest.raises(BundleError, match=rf"is damaged .*{how}.*build it again"):
            opened.world(layout)
    assert opened.world(third) is known


@pytest.mark.parametrize("content", [None, b"not JSON", b"\xff"])
def test_a_bundle_without_a_readable_catalogue_is_refused(copied: Path, content: bytes | None) -> None:
    folder = current_bundle(copied.parent, "sakai2021")
    if content is None:
        (folder / "catalogue.json").unlink()
    else:
        (folder / "catalogue.json").write_bytes(content)
    with pytest.raises(BundleError, match=r"is no study bundle .*; run `xar build`"):
        Catalogue.open(folder)


def test_an_instance_without_a_bundle_says_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(BundleError, match=r"there is no bundle of study 'sakai2021' in .*; run `xar build`"):
        current_bundle(tmp_path, "sakai2021")


@pytest.mark.parametrize("content", ["", "../../elsewhere", "abc"])
def test_a_pointer_that_names_no_bundle_is_refused(copied: Path, content: str) -> None:
    (copied / "current-sakai2021").write_text(content)
    with pytest.raises(BundleError, match="does not name a bundle"):
        current_bundle(copied.parent, "sakai2021")


def test_a_strip_needs_an_action_between_each_two_pictures() -> None:
    frame = Frame("0" * 64, "A wall.")
    with pytest.raises(ValueError, match="one action fewer"):
        Strip((frame, frame), ())


def test_reading_a_bundle_loads_nothing_heavy(planned_instance: Path) -> None:
    heavy = ["torch", "numpy", "PIL", "gymnasium", "minigrid", "pandas", "scipy", "matplotlib", "rich"]
    program = (
        "import sys; from pathlib import Path; from webapp.stimuli.catalogue import Catalogue, current_bundle;"
        "import webapp.study.session, webapp.study.questionnaire;"
        f"catalogue = Catalogue.open(current_bundle(Path({str(planned_instance)!r}), 'sakai2021'));"
        "catalogue.world('simulation').key_points(1, ['left']);"
        f"print([name for name in {heavy} if name in sys.modules])"
    )
    finished = subprocess.run([sys.executable, "-c", program], check=True, capture_output=True, text=True)
    assert finished.stdout == "[]\n"


def test_a_bundle_of_another_format_is_refused(tmp_path: Path) -> None:
    (tmp_path / "draft").mkdir()
    (tmp_path / "draft" / "catalogue.json").write_text('{"format": 1}', encoding="utf-8")
    folder = (tmp_path / "draft").rename(tmp_path / bundle_version(tmp_path / "draft"))
    with pytest.raises(BundleError, match=r"has format 1, not 2; build it again"):
        Catalogue.open(folder)
