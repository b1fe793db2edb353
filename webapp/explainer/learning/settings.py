"""Everything about training that is a matter of choice. Sakai et al. 2021 publish none of it: all of it is ours."""

import dataclasses
import math
from dataclasses import dataclass

from webapp.explainer.learning.ranges import check_number


@dataclass(frozen=True, slots=True)
class TrainingSettings:
    """The hyperparameters of one training run.

    An iteration is one action in each of an agent's environments, `num_policy_updates` updates of its DQN and one
    update of its world model. Learning rates move in cycles of `cycle_iterations`: constant at first, then down along
    a half cosine, then constant at `final_rate_share` of the first; whoever has not passed the stop test by then
    starts another cycle with all that it knows.

    Attributes:
        num_environments: Copies of the world in which each agent acts side by side.
        num_exploring_environments: How many of these only explore; in the others the DQN acts, too.
        most_exploration: The share of exploring actions in the first environment in which the DQN acts.
        least_exploration: The same in the last one; those between are spaced evenly.
        least_tried_share: The share of exploring actions that are the least tried of their state, not any.
        visited_start_share: The share of episodes that begin in a visited state and not at the start; at most 0.5.
        max_episode_steps: An episode is abandoned after so many actions, as if truncated by the environment.
        num_warmup_steps: Actions per environment before the first update.
        discount: Of the DQN, per action.
        policy_units: Units in each of the DQN's two hidden layers.
        policy_batch: Transitions per update of the DQN.
        num_policy_updates: Updates of the DQN per iteration.
        policy_learning_rate: Adam's step size for the DQN.
        target_rate: The share of the DQN that moves into its target network at each update.
        model_units: Hidden units of the world model's recurrent layer.
        num_sequences: Sequences per update of the world model, each of them from a zero hidden state.
        sequence_length: Transitions per sequence (truncated backpropagation through time).
        num_single_queries: Single transitions per update of the world model, each from a zero hidden state.
        num_borrowed_queries: Single transitions per update of the world model, each from a hidden state that one of
            the sequences has just reached elsewhere.
        model_learning_rate: Adam's step size for the world model.
        recurrent_scale: The size of the first recurrent weights, as a share of torch's default.
        max_gradient_norm: Gradients are scaled down to this norm, for each agent and network by itself.
        even_share: The share of replayed transitions drawn evenly over the state-action pairs that were met; the rest
            are drawn by priority.
        policy_priority_exponent: The DQN replays pairs in proportion to this power of their last loss.
        model_priority_exponent: The same for the world model.
        refresh_iterations: The replay's weights are brought up to date every so many iterations.
        cycle_iterations: Iterations per cycle of learning rates.
        num_cycles: The budget.
        constant_share: The share of a cycle with the full learning rate.
        final_share: The share of a cycle, at its end, with the smallest learning rate.
        final_rate_share: The smallest learning rate as a share of the full one.
        window_iterations: The stop test compares the mean losses of the last two windows of so many iterations.
        max_relative_change: A loss has flattened when its mean changed by less than this share.
        checkpoint_iterations: The stop test is taken every so many iterations.

    Raises:
        ValueError: A setting is outside its range; the message names it.

    Example:
        >>> from webapp.explainer import TrainingSettings
        >>> TrainingSettings(num_cycles=1).max_iterations
        1600
    """

    num_environments: int = 24
    num_exploring_environments: int = 16
    most_exploration: float = 0.5
    least_exploration: float = 0.1
    least_tried_share: float = 0.8
    visited_start_share: float = 0.5
    max_episode_steps: int = 100
    num_warmup_steps: int = 700
    discount: float = 0.9
    policy_units: int = 64
    policy_batch: int = 256
    num_policy_updates: int = 2
    policy_learning_rate: float = 2e-3
    target_rate: float = 0.1
    model_units: int = 96
    num_sequences: int = 16
    sequence_length: int = 8
    num_single_queries: int = 128
    num_borrowed_queries: int = 96
    model_learning_rate: float = 6e-3
    recurrent_scale: float = 0.2
    max_gradient_norm: float = 1.0
    even_share: float = 0.5
    policy_priority_exponent: float = 0.5
    model_priority_exponent: float = 1.0
    refresh_iterations: int = 10
    cycle_iterations: int = 1600
    num_cycles: int = 3
    constant_share: float = 0.4
    final_share: float = 0.3
    final_rate_share: float = 0.0001
    window_iterations: int = 150
    max_relative_change: float = 0.01
    checkpoint_iterations: int = 25

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value, may_be_zero = getattr(self, field.name), field.name in _COUNTS_FROM_ZERO | _SHARES
            check_number(field.name, value, whole=field.type is int, may_be_zero=may_be_zero)
            if field.name in _SHARES and value > 1:
                raise ValueError(f"{field.name} must be from 0 to 1, not {value!r}")
        if self.num_exploring_environments > self.num_environments:
            raise ValueError(f"num_exploring_environments must be at most {self.num_environments}, num_environments")
        if self.visited_start_share > _LARGEST_VISITED_START_SHARE:
            raise ValueError(f"visited_start_share must be at most 0.5, not {self.visited_start_share}")
        if self.constant_share + self.final_share > 1:
            raise ValueError("constant_share and final_share must not exceed 1 together")
        if self.num_borrowed_queries > self.num_sequences * self.sequence_length:
            raise ValueError("num_borrowed_queries must be at most num_sequences * sequence_length")
        if self.sequence_length > self.num_warmup_steps:
            raise ValueError(f"sequence_length must be at most {self.num_warmup_steps}, num_warmup_steps")

    def to_dict(self) -> dict[str, int | float]:
        """Return every setting by name, for a manifest."""
        return dataclasses.asdict(self)

    @property
    def max_iterations(self) -> int:
        """The budget in iterations."""
        return self.num_cycles * self.cycle_iterations

    def rate_share(self, iteration: int) -> float:
        """Return the learning rate of an iteration, counted from 0, as a share of the full one."""
        done = iteration % self.cycle_iterations / self.cycle_iterations
        falling = 1 - self.constant_share - self.final_share
        fallen = (done - self.constant_share) / falling if falling > 0 else float(done >= self.constant_share)
        height = (1 + math.cos(math.pi * min(max(fallen, 0.0), 1.0))) / 2
        return self.final_rate_share + (1 - self.final_rate_share) * height


_LARGEST_VISITED_START_SHARE = 0.5
_COUNTS_FROM_ZERO = frozenset(
    {"num_borrowed_queries", "num_exploring_environments", "policy_priority_exponent", "model_priority_exponent"}
)
_SHARES = frozenset(
    {
        "most_exploration",
        "least_exploration",
        "least_tried_share",
        "visited_start_share",
        "discount",
        "target_rate",
        "recurrent_scale",
        "even_share",
        "constant_share",
        "final_share",
        "final_rate_share",
        "max_relative_change",
    }
)
