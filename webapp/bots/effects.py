"""The effects that are planted: how a kind of explanation changes ratings, predictions and drives."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from webapp.bots.errors import BotError
from webapp.bots.mix import near
from webapp.study.experiments import SATISFACTION_ITEMS
from webapp.study.protocol import Study

PROBE = "probe"
DRIVE = "drive"
_EVERY_ITEM = ""


@dataclass(frozen=True, slots=True)
class Effects:
    """Shifts by kind and by what they shift; what is not there is 0.

    Attributes:
        shifts: By (kind, target). A target is an item's id, or empty for every rating item, both in points of the
            scale; `probe` or `drive`, a difference of probabilities.
    """

    shifts: Mapping[tuple[str, str], float] = field(default_factory=dict)

    def on_rating(self, kind: str, item: str) -> float:
        """Return the shift of an item; one declared for the item itself stands instead of that for all."""
        return self.shifts.get((kind, item), self.shifts.get((kind, _EVERY_ITEM), 0.0))

    def on_prediction(self, kind: str) -> float:
        """Return the shift of the probability of a right prediction."""
        return self.shifts.get((kind, PROBE), 0.0)

    def on_drive(self, kind: str) -> float:
        """Return the shift of the probability that the drive after the explanation arrives."""
        return self.shifts.get((kind, DRIVE), 0.0)


def parse_effects(texts: Sequence[str], study: Study) -> Effects:
    """Read effects such as `subgoals=0.5`, `full.general=-1`, `subgoals.probe=0.2`, `subgoals.drive=0.1`.

    Raises:
        BotError: One cannot be read, or names what the study does not have.
    """
    shifts: dict[tuple[str, str], float] = {}
    kinds = {kind: None for experiment in study.experiments for kind in experiment.kinds}
    targets = _targets(study)
    for text in texts:
        name, equals, delta = (word.strip() for word in text.partition("="))
        kind, dot, target = name.partition(".")
        if not equals or (dot and not target):
            raise BotError(f"--effect is {text!r}; write KIND=DELTA, KIND.ITEM=DELTA, KIND.probe=P or KIND.drive=P")
        if kind not in kinds:
            raise BotError(f"--effect names the kind {kind!r}; {near(kind, kinds, f'the kinds of {study.name}')}")
        if target and target not in targets:
            wish = near(target, targets, "it can be on")
            raise BotError(f"--effect {text!r} is on {target!r}; {wish}")
        if (kind, target) in shifts:
            raise BotError(f"--effect names {name!r} twice; give it one value")
        shifts[kind, target] = _delta(text, delta, is_probability=target in {PROBE, DRIVE})
    return Effects(shifts)


def _targets(study: Study) -> dict[str, None]:
    items = [item.id for experiment in study.experiments for item in experiment.items]
    if any(experiment.satisfaction for experiment in study.experiments):
        items += SATISFACTION_ITEMS
    if any(experiment.probe for experiment in study.experiments):
        items.append(PROBE)
    if any(experiment.drive for experiment in study.experiments):
        items.append(DRIVE)
    return dict.fromkeys(items)


def _delta(text: str, delta: str, *, is_probability: bool) -> float:
    try:
        value = float(delta)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise BotError(f"--effect is {text!r}; after the = stands a number")
    if is_probability and not -1 <= value <= 1:
        raise BotError(f"--effect is {text!r}; a difference of probabilities is from -1 to 1")
    return value
