"""A study bundle, read-only: all that a request ever sees of worlds, agents and explanations.

A bundle is a folder named after the hash of its content:

- `catalogue.json`: the study, the texts, and what is shown in each trial, for each language;
- `tables/<layout>.json`: states, transitions, the picture of each state, path, importance (see `stimuli.tables`);
- `pictures/<digest>.png`: every view that can be reached, once;
- `weights.safetensors`: the agents and world models;
- `manifest.json`: what it was made with, and the build report.

This module imports neither NumPy nor Pillow nor torch, so that a web worker stays small.
"""

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from webapp.study.protocol import Study
from webapp.study.session import Trial
from webapp.study.texts import Texts

CATALOGUE_FORMAT = 1
"""Raised when a bundle of an earlier program can no longer be read."""

_DIGEST = re.compile(r"[0-9a-f]{64}")


class BundleError(ValueError):
    """A bundle that is missing, damaged, or made by another version of the program."""


@dataclass(frozen=True, slots=True)
class Frame:
    """One picture of the agent's view.

    Attributes:
        digest: SHA-256 of the picture's bytes, in hexadecimal; also its file name.
        alt: The picture in words, in the language asked for.
    """

    digest: str
    alt: str


@dataclass(frozen=True, slots=True)
class Strip:
    """Pictures in order of time, with the action between each and the next.

    Attributes:
        frames: At least one.
        actions: The actions in the language asked for, one fewer than frames.
    """

    frames: tuple[Frame, ...]
    actions: tuple[str, ...]

    def __post_init__(self) -> None:
        if len(self.frames) != len(self.actions) + 1:
            raise ValueError(f"{len(self.frames)} pictures need one action fewer between them, not {len(self.actions)}")


@dataclass(frozen=True, slots=True)
class Situation:
    """What a participant sees before an explanation.

    Attributes:
        current: The agent's view when the explanation is given.
        video: What happened so far, ending with the current view; None where only the current view is shown.
        announced: The next actions, in the language asked for; empty where none are announced.
    """

    current: Frame
    video: Strip | None
    announced: tuple[str, ...]


class Catalogue:
    """The bundle of one study. Make one with `Catalogue.open`.

    Attributes:
        study: The study as declared.
        version: The hash of the bundle's content, 64 hexadecimal digits; the column `study_version` of the data.
    """

    def __init__(self, folder: Path, version: str, content: Mapping[str, Any]) -> None:
        self.study = Study.model_validate_json(json.dumps(content["study"]))
        self.version = version
        self._folder = folder
        self._texts = {language: _texts(language, entries) for language, entries in content["texts"].items()}
        self._digests: tuple[str, ...] = tuple(content["pictures"]["digests"])
        self._alts: dict[str, tuple[str, ...]] = {key: tuple(alts) for key, alts in content["pictures"]["alts"].items()}
        self._known = frozenset(self._digests)
        self._actions: tuple[str, ...] = tuple(content["actions"])
        self._trials = content["trials"]

    @classmethod
    def open(cls, folder: Path) -> "Catalogue":
        """Open a bundle.

        Args:
            folder: The bundle's folder, named after its version.

        Raises:
            BundleError: There is no bundle, its content is not what its name says, or it is of another format.
        """
        try:
            content = json.loads((folder / "catalogue.json").read_text(encoding="utf-8"))
            version = bundle_version(folder)
        except (OSError, UnicodeDecodeError, json.JSONDecodeError) as error:
            raise BundleError(f"{folder} is no study bundle ({error}); run `xar build`") from None
        if version != folder.name:
            raise BundleError(f"the study bundle {folder} is damaged: its content gives {version}; build it again")
        if content["format"] != CATALOGUE_FORMAT:
            raise BundleError(f"{folder} has format {content['format']}, not {CATALOGUE_FORMAT}; build it again")
        return cls(folder, version, content)

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

    def explanation(self, trial: Trial, language: str) -> tuple[Strip, ...]:
        """Return a trial's explanation: the current view first, then what is shown of the way to the goal.

        Raises:
            KeyError: The study has no such experiment, layout, kind or language.
            IndexError: The random kind has no such draw.
        """
        variants = self._trials[trial.experiment][trial.layout]["explanations"][trial.kind]
        return tuple(self._strip(strip, language) for strip in variants[trial.draw or 0])

    def picture_path(self, digest: str) -> Path | None:
        """Return the file of a picture, or None if the bundle has no picture of this digest."""
        return self._folder / "pictures" / f"{digest}.png" if digest in self._known else None

    def _frame(self, index: int, language: str) -> Frame:
        return Frame(digest=self._digests[index], alt=self._alts[language][index])

    def _strip(self, strip: Mapping[str, Sequence[int]], language: str) -> Strip:
        frames = tuple(self._frame(index, language) for index in strip["frames"])
        return Strip(frames, self._wordings(strip["actions"], language))

    def _wordings(self, actions: Sequence[int], language: str) -> tuple[str, ...]:
        texts = self._texts[language]
        return tuple(texts(f"actions.{self._actions[action]}") for action in actions)


def bundle_version(folder: Path) -> str:
    """Hash a bundle's content: the path and the bytes of every file, in the order of the paths.

    Returns:
        SHA-256 in hexadecimal.
    """
    digest = hashlib.sha256()
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        content = hashlib.sha256(path.read_bytes()).hexdigest()
        digest.update(f"{content}  {path.relative_to(folder).as_posix()}\n".encode())
    return digest.hexdigest()


def current_bundle(instance: Path, study: str) -> Path:
    """Return the folder of the bundle that was built last for a study.

    Args:
        instance: The instance folder.
        study: The study's name.

    Raises:
        BundleError: No bundle was built.
    """
    pointer = instance / "bundles" / f"current-{study}"
    try:
        version = pointer.read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError):
        raise BundleError(f"there is no bundle of study {study!r} in {instance}; run `xar build`") from None
    if not _DIGEST.fullmatch(version):
        raise BundleError(f"{pointer} does not name a bundle; run `xar build`")
    return instance / "bundles" / version


def _texts(language: str, entries: Mapping[str, str | list[str]]) -> Texts:
    return Texts(language, {key: tuple(text) if isinstance(text, list) else text for key, text in entries.items()})
