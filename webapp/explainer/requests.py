"""What can be asked about a map or an environment, checked before anything is enumerated or learned."""

from dataclasses import dataclass
from typing import Literal

from webapp.explainer.granularity import RANDOM_STEPS as COARSE_RANDOM_STEPS
from webapp.explainer.granularity import Granularity
from webapp.explainer.importance import PROBABILITY_KINDS, ImportanceKind
from webapp.explainer.questioner import Belief
from webapp.explainer.subgoals import ThresholdRule
from webapp.explainer.subjects import PolicyKind, WorldKind

EstimatorKind = Literal["exact", "monte-carlo"]

FINE_RANDOM_STEPS = 10
"""The default r where every step is explained."""


@dataclass(frozen=True, slots=True)
class Request:
    """What somebody wants to know.

    Attributes:
        world: The table of the rules, or the world model learned from experience in it.
        policy: The planner's shortest path in that world, all shortest paths alike, or the learned agent's.
        importance: Which definition of importance.
        estimator: Exactly, or by sampling; in a learned world by rollouts through the recurrent network.
        random_steps: r, at least 0; left out, 10 for steps and 1 for anything coarser.
        discount: Of rewards and of the planner in stochastic worlds, from above 0 to below 1.
        num_trials: Rollouts per state and probability, at least 1; an exact estimator needs none.
        stops_early: Whether sampling ends as soon as each state's side of the threshold is settled.
        seed: Of the sampling and of the training, at least 0.
        threshold: The rule that separates subgoals from the rest.
        num_subgoals: k of the rule that needs it.
        route: The names of the questioner's actions, if somebody asks.
        from_step: The step at which they ask, from 1.
        belief: The map on which the questioner plans that route, where it is not given.
        granularity: Whether the path's steps are explained, or what they achieve.

    Raises:
        ValueError: A number is out of range, the route is empty, or two parts contradict each other.
    """

    world: WorldKind = "exact"
    policy: PolicyKind = "planner"
    importance: ImportanceKind = "return_probability"
    estimator: EstimatorKind = "exact"
    random_steps: int | None = None
    discount: float = 0.99
    num_trials: int = 1000
    stops_early: bool = False
    seed: int = 0
    threshold: ThresholdRule = "mean"
    num_subgoals: int | None = None
    route: tuple[str, ...] | None = None
    from_step: int = 1
    belief: Belief | None = None
    granularity: Granularity = "steps"

    def __post_init__(self) -> None:
        least = {"num_trials": 1, "seed": 0, "from_step": 1}
        for name, smallest in least.items():
            if getattr(self, name) < smallest:
                raise ValueError(f"{name} must be {smallest} or larger, not {getattr(self, name)}")
        if self.r < 0:
            raise ValueError(f"random_steps must be 0 or larger, not {self.random_steps}")
        if not 0 < self.discount < 1:
            raise ValueError(f"the discount must lie above 0 and below 1, not {self.discount}")
        if (self.threshold == "top-k") != (self.num_subgoals is not None):
            raise ValueError("a number of subgoals belongs to the threshold top-k, and top-k needs it")
        if self.route is not None and self.belief is not None:
            raise ValueError("a route and a believed map are two ways of asking; give one of them")
        if self.route is not None and not self.route:
            raise ValueError("a route has at least one action; leave it out when nobody asks")
        self._check_estimator()

    def _check_estimator(self) -> None:
        if self.estimator == "exact":
            if self.stops_early:
                raise ValueError("only sampling can stop early; take the monte-carlo estimator")
            return
        if self.importance not in PROBABILITY_KINDS:
            raise ValueError(f"{self.importance} is not a probability and cannot be sampled; take the exact estimator")
        if self.granularity != "steps":
            raise ValueError(f"{self.granularity} are explained exactly, not by sampling; take the exact estimator")
        if self.stops_early and self.threshold != "mean":
            raise ValueError("sampling can stop early for the threshold mean only; leave one of the two out")

    def __str__(self) -> str:
        """Say in one line what is asked."""
        importance = {
            "return_probability": f"return probability after {self.r} random actions",
            "ace": f"average causal effect after {self.r} random actions",
            "reward_importance": f"reward lost without the best action, discount {self.discount}",
        }[self.importance]
        sampled = f", {self.num_trials} trials per state, seed {self.seed}"
        return f"{self.world} world, {self.policy}, {importance}, {self.estimator}" + (
            sampled if self.estimator == "monte-carlo" else ""
        )

    @property
    def r(self) -> int:
        """The number of random actions, coarse ones where the granularity is."""
        if self.random_steps is not None:
            return self.random_steps
        return FINE_RANDOM_STEPS if self.granularity == "steps" else COARSE_RANDOM_STEPS

    @property
    def learns(self) -> bool:
        """Whether a network must be trained first."""
        return self.world == "learned" or self.policy == "dqn"
