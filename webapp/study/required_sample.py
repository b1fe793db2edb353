"""How many participants a planned analysis needs, as `xar power` left it for `xar study check`.

A small file for each design and plan. Its name is a digest of what the number depends on, so that a change of kinds,
layouts, items or contrasts leaves a file that is not looked at any more, and a change of texts leaves it in place.
"""

import hashlib
import json
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from webapp.study.analysis_plan import Plan
from webapp.study.protocol import Study

_FORMAT = 1
_FOLDER = "power"


@dataclass(frozen=True, slots=True)
class RequiredSample:
    """How many participants an effect needs.

    Attributes:
        effect: The standardised difference d of the latent ratings.
        participants: The smallest number with which every planned contrast has the power, None if more than the
            largest number that was tried are needed.
    """

    effect: float
    participants: int | None


@dataclass(frozen=True, slots=True)
class RequiredSamples:
    """What a run of `xar power` found.

    Attributes:
        power: The power that was asked for, between 0 and 1.
        num_studies: The simulated studies behind each power.
        most_participants: The largest number that was tried.
        samples: By effect, ascending.
    """

    power: float
    num_studies: int
    most_participants: int
    samples: tuple[RequiredSample, ...]

    def __str__(self) -> str:
        needed = ", ".join(f"{self._number(sample)} for d = {_short(sample.effect)}" for sample in self.samples)
        source = f"power {_short(self.power)}; xar power, {self.num_studies} simulated studies"
        return f"Required participants: {needed} ({source})."

    def _number(self, sample: RequiredSample) -> str:
        return f"more than {self.most_participants}" if sample.participants is None else str(sample.participants)


def design_digest(study: Study, plan: Plan) -> str:
    """Return 32 hexadecimal digits that change whenever the design or the plan does, and with no wording."""
    design = [
        {
            "id": experiment.id,
            "layouts": experiment.layouts,
            "layout_order": experiment.layout_order,
            "kinds": experiment.kinds,
            "items": [item.model_dump(mode="json") for item in experiment.items],
        }
        for experiment in study.experiments
    ]
    planned = {
        "contrasts": [asdict(contrast) for contrast in plan.contrasts],
        "items": {experiment: list(items) for experiment, items in plan.items.items()},
        "alpha": plan.alpha,
    }
    text = json.dumps({"format": _FORMAT, "design": design, "plan": planned}, sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def write_required(instance: Path, digest: str, found: RequiredSamples) -> Path:
    """Leave what was found in an instance, in place of what was found before, and return the file.

    Raises:
        OSError: It cannot be written.
    """
    path = _path(instance, digest)
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    draft = path.with_name(f".{path.name}.{os.getpid()}.part")
    draft.write_text(json.dumps(asdict(found), indent=2, sort_keys=True) + "\n", encoding="utf-8")
    draft.replace(path)
    return path


def read_required(instance: Path, digest: str) -> RequiredSamples | None:
    """Return what was found for a design and plan, None if there is nothing that can be read."""
    try:
        told = json.loads(_path(instance, digest).read_text(encoding="utf-8"))
        samples = tuple(_sample(sample) for sample in _list(told["samples"]))
        return RequiredSamples(float(told["power"]), int(told["num_studies"]), int(told["most_participants"]), samples)
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _sample(told: dict[str, object]) -> RequiredSample:
    effect, participants = told["effect"], told["participants"]
    if not isinstance(effect, float | int) or not isinstance(participants, int | None):
        raise TypeError(f"a sample is an effect and a number, not {told}")
    return RequiredSample(float(effect), participants)


def _list(value: object) -> Sequence[dict[str, object]]:
    if not isinstance(value, list):
        raise TypeError(f"the samples are a list, not {value!r}")
    return value


def _path(instance: Path, digest: str) -> Path:
    return instance / _FOLDER / f"{digest}.json"


def _short(number: float) -> str:
    """Write a number between 0 and 1 as papers do, without the zero."""
    return f"{number:g}".removeprefix("0") if 0 < number < 1 else f"{number:g}"
