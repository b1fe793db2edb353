"""A study bundle, read-only: all that a request ever sees of worlds, agents and explanations.

A bundle is a folder named after the hash of its content:

- `catalogue.json`: the study, the texts, and what is shown in each trial, for each language;
- `tables/<layout>.json`: states, transitions, the picture of each state, path, importance, the path in words (see
  `stimuli.tables`); read when it is first asked for, and compared with what it was when the bundle was opened;
- `pictures/<digest>.png`: every view that can be reached, once; compared with its name when it is sent;
- `weights.safetensors`: the agents and world models;
- `manifest.json`: what it was made with, and the build report.

This module imports neither NumPy nor Pillow nor torch, so that a web worker stays small.
"""

import hashlib
import json
import threading
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from webapp.stimuli.bundle_files import BundleError, bundle_version, current_bundle, file_digests, version_of
from webapp.stimuli.layout_table import LayoutTable, parse_layout_table
from webapp.stimuli.picture_files import Picture, PictureFiles
from webapp.stimuli.shown import Frame, ProbeQuestion, Situation, Strip
from webapp.stimuli.world_table import WorldTable
from webapp.study.experiments import TAILORED_KINDS
from webapp.study.protocol import Study
from webapp.study.session import Trial
from webapp.study.texts import Texts

__all__ = [
    "CATALOGUE_FORMAT",
    "BundleError",
    "Catalogue",
    "Frame",
    "Picture",
    "ProbeQuestion",
    "Situation",
    "Strip",
    "bundle_version",
    "current_bundle",
]

CATALOGUE_FORMAT = 2
"""Raised when a bundle of an earlier program can no longer be read."""


class Catalogue:
    """The bundle of one study. Make one with `Catalogue.open`.

    Attributes:
        folder: Where its files are.
        study: The study as declared.
        version: The hash of the bundle's content, 64 hexadecimal digits; the column `study_version` of the data.
    """

    def __init__(
        self, folder: Path, version: str, content: Mapping[str, Any], table_digests: Mapping[str, str]
    ) -> None:
        self.study = Study.model_validate_json(json.dumps(content["study"]))
        self.version = version
        self.folder = folder
        self._texts = {language: _texts(language, entries) for language, entries in content["texts"].items()}
        self._digests: tuple[str, ...] = tuple(content["pictures"]["digests"])
        self._alts: dict[str, tuple[str, ...]] = {key: tuple(alts) for key, alts in content["pictures"]["alts"].items()}
        self._known = frozenset(self._digests)
        self._actions: tuple[str, ...] = tuple(content["actions"])
        self._trials = content["trials"]
        self._pictures = PictureFiles(folder / "pictures")
        self._tables: dict[str, LayoutTable] = {}
        self._table_digests = table_digests
        self._lock = threading.Lock()

    @classmethod
    def open(cls, folder: Path) -> "Catalogue":
        """Open a bundle.

        Args:
            folder: The bundle's folder, named after its version.

        Raises:
            BundleError: There is no bundle, its content is not what its name says, or it is of another format.
        """
        try:
            text = (folder / "catalogue.json").read_bytes()
            content = json.loads(text)
            digests = file_digests(folder)
        except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
            raise BundleError(f"{folder} is no study bundle ({error}); run `xar build`") from None
        version = version_of(digests)
        if version != folder.name or hashlib.sha256(text).hexdigest() != digests["catalogue.json"]:
            raise BundleError(f"the study bundle {folder} is damaged: its content gives {version}; build it again")
        if content["format"] != CATALOGUE_FORMAT:
            raise BundleError(f"{folder} has format {content['format']}, not {CATALOGUE_FORMAT}; build it again")
        tables = {name: digest for name, digest in digests.items() if name.startswith("tables/")}
        return cls(folder, version, content, tables)

    @property
    def digests(self) -> tuple[str, ...]:
        """The digests of all pictures of the bundle."""
        return self._digests

    def texts(self, language: str) -> Texts:
        """Return the texts of a language.

        Raises:
            KeyError: The study has no such language.
        """
        return self._texts[language]

    def situation(self, trial: Trial, language: str) -> Situation:
        """Return what is shown before a trial's explanation.

        Raises:
            KeyError: The study has no such experiment, layout or language.
        """
        shown = self._trials[trial.experiment][trial.layout]["situation"]
        return Situation(
            current=self._frame(shown["current"], language),
            video=None if shown["video"] is None else self._strip(shown["video"], language),
            announced=self._wordings(shown["announced"], language),
        )

    def explanation(self, trial: Trial, language: str, key_points: Sequence[int] | None = None) -> tuple[Strip, ...]:
        """Return a trial's explanation: the current view first, then what is shown of the way to the goal.

        Args:
            trial: The trial.
            language: The language of the words.
            key_points: For a tailored kind, and for no other: the steps that the participant's own route missed.
                Whoever missed none is shown all the subgoals.

        Raises:
            KeyError: The study has no such experiment, layout, kind or language, or a key point is no subgoal from the
                trial's step on.
            IndexError: The random kind has no such draw.
            ValueError: The key points of a tailored kind are missing, or another kind has some.
        """
        if (key_points is None) == (trial.kind in TAILORED_KINDS):
            raise ValueError(f"key points belong to a tailored kind and to no other, and this is {trial.kind!r}")
        shown = self._trials[trial.experiment][trial.layout]
        if key_points is None:
            strips = shown["explanations"][trial.kind][trial.draw or 0]
        else:
            strips = [_only(shown["situation"]["current"]), *_tailored(trial, shown["pairs"], key_points)]
        return tuple(self._strip(strip, language) for strip in strips)

    def from_step(self, trial: Trial) -> int:
        """Return the step, from 1, at which a trial's explanation is given.

        Raises:
            KeyError: The study has no such experiment or layout.
        """
        step: int = self._trials[trial.experiment][trial.layout]["from_step"]
        return step

    def probes(self, experiment_id: str, layout: str) -> tuple[ProbeQuestion, ...]:
        """Return the questions what the agent does next, in order; none where the experiment asks for no prediction.

        Raises:
            KeyError: The study has no such experiment or layout.
        """
        return tuple(
            ProbeQuestion(
                state=probe["state"],
                action=self._actions[probe["action"]],
                as_good=tuple(self._actions[action] for action in probe["as_good"]),
            )
            for probe in self._trials[experiment_id][layout]["probes"]
        )

    def world(self, layout: str) -> WorldTable:
        """Return the world of a layout and what the agent does in it. It is read when first asked for, and kept.

        Raises:
            KeyError: The study has no such layout.
            BundleError: The table has gone or was damaged since the bundle was opened.
        """
        return self._table(layout).world

    def view(self, layout: str, state: int, language: str) -> Frame:
        """Return what the agent sees in a state of a layout's world.

        Raises:
            KeyError: The study has no such layout or language.
            IndexError: There is no such state.
        """
        return self._frame(self._table(layout).pictures[state], language)

    def strips_of(self, layout: str, steps: Sequence[int], language: str, from_step: int = 1) -> tuple[Strip, ...]:
        """Return the current view, then some steps of the agent's path as an explanation shows them.

        Args:
            layout: The layout.
            steps: From `from_step` to T, ascending.
            language: The language of the words.
            from_step: The step of the current view, from 1 to T.

        Raises:
            KeyError: The study has no such layout or language.
            ValueError: There is no such step, or the steps do not ascend.
        """
        pairs = self._table(layout).pairs(steps, from_step)
        return tuple(
            Strip(tuple(self._frame(picture, language) for picture in pictures), self._wordings(actions, language))
            for pictures, actions in pairs
        )

    def sentences(self, layout: str, language: str) -> dict[int, str]:
        """Return what the agent does at each step of its path, from 1, in words.

        Raises:
            KeyError: The study has no such layout or language.
        """
        return dict(enumerate(self._table(layout).sentences[language], start=1))

    def action_name(self, action: int | str, language: str) -> str:
        """Return what an action, given by its number or its name, is called in a language.

        Raises:
            KeyError: The study has no such language.
            IndexError: There is no action of this number.
            MissingTextError: There is no action of this name.
        """
        name = action if isinstance(action, str) else self._actions[action]
        return self._texts[language](f"actions.{name}")

    def picture(self, digest: str) -> Picture | None:
        """Return a picture as it was built, or None if the bundle has no picture of this digest.

        Raises:
            BundleError: The file has gone or was changed.
        """
        if digest not in self._known:
            return None
        try:
            return self._pictures.read(digest)
        except (OSError, ValueError) as error:
            raise self._damaged(error) from None

    def _table(self, layout: str) -> LayoutTable:
        if layout not in self.study.layouts:
            raise KeyError(layout)
        with self._lock:
            if layout not in self._tables:
                name = f"tables/{layout}.json"
                try:
                    text = (self.folder / name).read_bytes()
                except OSError as error:
                    raise self._damaged(error) from None
                if hashlib.sha256(text).hexdigest() != self._table_digests.get(name):
                    raise self._damaged(f"{name} was changed since it was opened")
                self._tables[layout] = parse_layout_table(text, layout)
            return self._tables[layout]

    def _damaged(self, how: object) -> BundleError:
        return BundleError(f"the study bundle {self.folder} is damaged ({how}); build it again")

    def _frame(self, index: int, language: str) -> Frame:
        return Frame(digest=self._digests[index], alt=self._alts[language][index])

    def _strip(self, strip: Mapping[str, Sequence[int]], language: str) -> Strip:
        frames = tuple(self._frame(index, language) for index in strip["frames"])
        return Strip(frames, self._wordings(strip["actions"], language))

    def _wordings(self, actions: Sequence[int | str], language: str) -> tuple[str, ...]:
        return tuple(self.action_name(action, language) for action in actions)


def _texts(language: str, entries: Mapping[str, str | list[str]]) -> Texts:
    return Texts(language, {key: tuple(text) if isinstance(text, list) else text for key, text in entries.items()})


def _only(picture: int) -> dict[str, list[int]]:
    return {"frames": [picture], "actions": []}


def _tailored(trial: Trial, pairs: Mapping[str, Any], key_points: Sequence[int]) -> list[Any]:
    if not key_points:
        return [pairs[step] for step in sorted(pairs, key=int)]
    return [pairs[str(step)] for step in (key_points[:1] if trial.kind == "tailored_first" else key_points)]
