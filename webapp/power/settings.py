"""The settings of a run of `xar power`."""

import dataclasses
import math
from dataclasses import dataclass

from webapp.power.generation import BETWEEN_SD, within_sd

PARTICIPANTS = (10, 20, 30, 40, 60, 80, 120, 160, 240, 320, 400)
EFFECTS = (0.3, 0.5, 0.8)
PAPER_PARTICIPANTS = 60
"""Of Sakai et al. 2021, section 6."""

MOST_PARTICIPANTS = 10_000


@dataclass(frozen=True, slots=True)
class PowerSettings:
    """What is simulated.

    Attributes:
        effects: The standardised latent differences d, all above 0, ascending. No effect at all is always simulated
            too.
        participants: The numbers N, ascending.
        num_studies: Simulated studies for each effect and N, at least 2.
        between_sd: The standard deviation of people's own levels, of 1 in total.
        power: The power that is asked for, between 0 and 1.
        seed: Of all that is drawn, at least 0.

    Raises:
        ValueError: A number is out of range; the message names it.
    """

    effects: tuple[float, ...] = EFFECTS
    participants: tuple[int, ...] = PARTICIPANTS
    num_studies: int = 400
    between_sd: float = BETWEEN_SD
    power: float = 0.8
    seed: int = 2021

    def __post_init__(self) -> None:
        for name, values, least, most in (
            ("effects", self.effects, 0.01, 5),
            ("participants", self.participants, 2, MOST_PARTICIPANTS),
        ):
            wrong = [value for value in values if not (math.isfinite(value) and least <= value <= most)]
            if wrong:
                raise ValueError(f"{name} must lie from {least:g} to {most:g}, not at {wrong[0]:g}")
            if not values or list(values) != sorted(set(values)):
                raise ValueError(f"{name} must be at least one number, ascending and each once, not {list(values)}")
        for number, given, smallest in (("num_studies", self.num_studies, 2), ("seed", self.seed, 0)):
            if given < smallest:
                raise ValueError(f"{number} must be {smallest} or larger, not {given}")
        if not 0 < self.power < 1:
            raise ValueError(f"the power must lie between 0 and 1, not at {self.power:g}")
        within_sd(self.between_sd)

    def to_dict(self) -> dict[str, object]:
        """Return every setting by name, ready for JSON."""
        return dataclasses.asdict(self) | {"effects": list(self.effects), "participants": list(self.participants)}
