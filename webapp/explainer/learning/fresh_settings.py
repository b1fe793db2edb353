"""How fresh agents learn: the settings of the stacked DQN. Sakai et al. 2021 publish none of them: all are ours."""

import dataclasses
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.learning.ranges import check_number


@dataclass(frozen=True, slots=True)
class FreshSettings:
    """The hyperparameters of agents that begin with nothing and learn one world, many of them in lockstep.

    The algorithm is DQN (Mnih et al. 2015) with Adam, the Huber loss and uniform replay, as stable-baselines3 has it.
    Steps are counted for each agent by itself.

    Attributes:
        num_slots: How many agents advance together, the width of the stack. It is a setting because on some processors
            the width may change an agent's last bits.
        max_episodes: The budget: an agent that has not found the optimal policy after so many episodes is censored.
        units: Units in each of the two hidden layers.
        learning_rate: Adam's step size.
        discount: Of rewards, per action, from 0 up to, not including, 1. It decides which sub-rewards can be earned
            again without making it better never to arrive.
        batch_size: Transitions per update.
        train_interval: Actions per update.
        warmup_steps: Actions before the first update.
        target_interval: The target network is copied anew every so many actions; a multiple of `train_interval`.
        replay_capacity: Transitions kept; the oldest are forgotten first.
        final_exploration: The share of random actions once exploration has ceased to fall. It begins at 1.
        exploration_steps: The share of random actions falls in a straight line over so many actions.
        max_gradient_norm: Gradients are scaled down to this norm, for each agent by itself.
        sub_reward: The most that a sub-reward pays; it falls over time as the goal's reward does.

    Raises:
        TypeError: A setting is no number, or no whole number where one is needed; the message names it.
        ValueError: A setting is outside its range; the message names it.
    """

    num_slots: int = 32
    max_episodes: int = 200
    units: int = 64
    learning_rate: float = 1e-3
    discount: float = 0.85
    batch_size: int = 64
    train_interval: int = 4
    warmup_steps: int = 500
    target_interval: int = 500
    replay_capacity: int = 100_000
    final_exploration: float = 0.05
    exploration_steps: int = 100_000
    max_gradient_norm: float = 10.0
    sub_reward: float = 0.5

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value, may_be_zero = getattr(self, field.name), field.name in _MAY_BE_ZERO
            check_number(field.name, value, whole=field.type is int, may_be_zero=may_be_zero)
        if self.discount >= 1:
            raise ValueError(f"discount must be below 1, not {self.discount}")
        if self.final_exploration > 1:
            raise ValueError(f"final_exploration must be from 0 to 1, not {self.final_exploration}")
        if self.sub_reward > _LARGEST_SUB_REWARD:
            raise ValueError(f"sub_reward must be at most 0.5, the paper's largest, not {self.sub_reward}")
        if self.target_interval % self.train_interval:
            raise ValueError(
                f"target_interval must be a multiple of train_interval, {self.train_interval}, not "
                f"{self.target_interval}"
            )

    def exploration(self, num_steps: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the share of random actions `[W]` after so many actions `[W]`."""
        fallen = np.minimum(num_steps / self.exploration_steps, 1.0)
        share: NDArray[np.float64] = 1.0 + (self.final_exploration - 1.0) * fallen
        return share

    def to_dict(self) -> dict[str, int | float]:
        """Return every setting by name, for a manifest."""
        return dataclasses.asdict(self)


_LARGEST_SUB_REWARD = 0.5
_MAY_BE_ZERO = frozenset({"discount", "final_exploration", "sub_reward"})
