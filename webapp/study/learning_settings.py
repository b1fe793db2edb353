"""What a study file says about training and explaining its agents."""

from typing import Annotated, Literal

from pydantic import Field

from webapp.study.declared import Declared, Name, Seed


class LearningSettings(Declared):
    """What the study file says about training.

    Attributes:
        seeds: The seeds of layouts that need another than the study's, by layout.
        settings: Hyperparameters that differ from the defaults, by name; the build checks the names.
    """

    seeds: dict[Name, Seed] = Field(default_factory=dict)
    settings: dict[str, int | float] = Field(default_factory=dict)


class ExplanationSettings(Declared):
    """How importance is measured and how often the random explanation is drawn.

    Attributes:
        importance: `return_probability` or `ace` (Sakai et al. 2021, section 4.2.1).
        random_steps: The number of random actions before the policy takes over.
        num_draws: The number of seeded draws of the random explanation, per layout.
    """

    importance: Literal["return_probability", "ace"] = "return_probability"
    random_steps: Annotated[int, Field(ge=1, le=1000)] = 10
    num_draws: Annotated[int, Field(ge=1, le=1000)] = 10
