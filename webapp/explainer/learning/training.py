"""The training run: a DQN and a world model for every map, stacked, learning at once from the same experience.

Sakai et al. 2021, section 4.1. The DQN is a Double DQN (van Hasselt et al. 2016) with a target network that follows
slowly; the world model learns by cross-entropy, component by component.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray

from webapp.explainer.learning.agent import AgentNetworks, TrainedAgent
from webapp.explainer.learning.apprentice import Apprentice, NetworkName
from webapp.explainer.learning.encoding import NUM_ACTIONS, NUM_COMPONENTS, Encoding
from webapp.explainer.learning.networks import (
    StackedAdam,
    action_values,
    new_model_weights,
    new_policy_weights,
    padding_mask,
    select,
    stack,
    unroll,
    unstack,
)
from webapp.explainer.learning.replay import Codes, Experience
from webapp.explainer.learning.settings import TrainingSettings
from webapp.explainer.learning.threads import one_thread
from webapp.explainer.seeding import torch_seed
from webapp.explainer.worlds.layout import Layout


class TrainingFailed(RuntimeError):
    """The budget ended before every agent had passed the stop test; the message says what each was missing."""


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a training run has come.

    Attributes:
        iteration: Iterations done.
        max_iterations: The budget.
        num_agents: Agents in the run.
        num_passed: Those that have passed the stop test.
        fraction: A forecast of the share of the work that is done, from 0 to 1; it never falls. Most agents pass
            within the first cycle of learning rates, so that cycle counts for nine tenths.
    """

    iteration: int
    max_iterations: int
    num_agents: int
    num_passed: int
    fraction: float


def train(
    layouts: Sequence[Layout],
    settings: TrainingSettings,
    seeds: Sequence[int],
    progress: Callable[[Progress], None] | None = None,
) -> tuple[TrainedAgent, ...]:
    r"""Train one agent per map, all in one stack on one thread.

    Every agent is frozen at the first checkpoint at which it passes the stop test, and then leaves the stack. The
    same maps, settings and seeds give the same bytes on the same type of processor and build of torch. Who else is in
    the stack changes the last bits of an agent's arithmetic, which training amplifies: it ends with other weights.

    Args:
        layouts: The maps.
        settings: How to train.
        seeds: One per map, at least 0.
        progress: Told of every checkpoint.

    Raises:
        LayoutError: A goal cannot be reached.
        ValueError: There is not one seed for each map, or no map.
        TrainingFailed: The budget ended first.

    Example:
        >>> from webapp.explainer import TrainingSettings, follow, parse_layout, train
        >>> settings = TrainingSettings(cycle_iterations=400, window_iterations=50, max_relative_change=0.1)
        >>> (agent,) = train([parse_layout("######\n#>KDG#\n######")], settings, seeds=[0])
        >>> world = agent.tabulate()
        >>> [world.actions[action] for action in follow(world, agent.policy(world)).actions]
        ['pickup', 'forward', 'toggle', 'forward', 'forward']
    """
    if not layouts or len(layouts) != len(seeds):
        raise ValueError(f"training needs maps and as many seeds, not {len(layouts)} and {len(seeds)}")
    with one_thread():
        run = _Run(layouts, settings, seeds)
        for iteration in range(1, settings.max_iterations + 1):
            run.iterate(iteration - 1)
            if iteration % settings.checkpoint_iterations == 0 or iteration == settings.max_iterations:
                run.freeze_whoever_passes()
                if progress is not None:
                    progress(run.progress(iteration))
            if run.is_over:
                return run.graduates
        raise TrainingFailed(run.complaint())


class _Run:
    """The stack, the agents that still learn in it, and those that have passed."""

    def __init__(self, layouts: Sequence[Layout], settings: TrainingSettings, seeds: Sequence[int]) -> None:
        self._settings = settings
        self._common = Encoding.of(*layouts)
        agents = [Apprentice(layout, seed, self._common, settings) for layout, seed in zip(layouts, seeds, strict=True)]
        self._learning = dict(enumerate(agents))
        self._passed: dict[int, TrainedAgent] = {}
        own = [agent.encoding for agent in agents]
        generators = [_generator(seed, layout) for layout, seed in zip(layouts, seeds, strict=True)]
        policies = [new_policy_weights(e, settings.policy_units, g) for e, g in zip(own, generators, strict=True)]
        models = [
            new_model_weights(e, settings.model_units, settings.recurrent_scale, g)
            for e, g in zip(own, generators, strict=True)
        ]
        self._policy = StackedAdam(stack(policies, own, self._common), settings.max_gradient_norm)
        self._model = StackedAdam(stack(models, own, self._common), settings.max_gradient_norm)
        self._target = {name: tensor.detach().clone() for name, tensor in self._policy.weights.items()}
        self._mask = padding_mask(own, self._common)
        self._next_states = torch.from_numpy(self._common.states)
        for _ in range(settings.num_warmup_steps):
            self._explore()

    @property
    def is_over(self) -> bool:
        """Whether everybody has passed."""
        return not self._learning

    @property
    def graduates(self) -> tuple[TrainedAgent, ...]:
        """Those that have passed, in the order of their maps."""
        return tuple(self._passed[index] for index in sorted(self._passed))

    def progress(self, iteration: int) -> Progress:
        """Return how far the run is after some iterations."""
        cycle, budget = self._settings.cycle_iterations, self._settings.max_iterations
        first, rest = min(iteration / cycle, 1.0), max(iteration - cycle, 0) / max(budget - cycle, 1)
        fraction = 1.0 if self.is_over else 0.9 * first + 0.1 * rest
        return Progress(iteration, budget, len(self._learning) + len(self._passed), len(self._passed), fraction)

    def iterate(self, iteration: int) -> None:
        """Act, then improve both networks; iterations are counted from 0."""
        settings = self._settings
        share = settings.rate_share(iteration)
        self._explore()
        if iteration % settings.refresh_iterations == 0:
            for agent in self._learning.values():
                agent.refresh()
        updates = [
            self._improve_policies(share * settings.policy_learning_rate) for _ in range(settings.num_policy_updates)
        ]
        policy_losses = torch.stack(updates).mean(dim=0)
        model_losses = self._improve_models(share * settings.model_learning_rate)
        losses = zip(self._learning.values(), policy_losses.tolist(), model_losses.tolist(), strict=True)
        for agent, policy_loss, model_loss in losses:
            agent.close_iteration(policy_loss, model_loss)

    def freeze_whoever_passes(self) -> None:
        """Take the stop test; whoever passes it leaves the stack."""
        remaining = []
        for place, (index, agent) in enumerate(list(self._learning.items())):
            networks = self._networks(place, agent) if agent.has_flattened else None
            if networks is not None and agent.judge(networks).is_right:
                self._passed[index] = self._learning.pop(index).graduate(networks)
            else:
                remaining.append(place)
        if len(remaining) < self._mask.shape[0]:
            self._policy, self._model = self._policy.select(remaining), self._model.select(remaining)
            self._target, self._mask = select(self._target, remaining), self._mask[remaining]

    def complaint(self) -> str:
        """Say what the agents that still learn are missing."""
        complaints = []
        for place, (index, agent) in enumerate(self._learning.items()):
            flat = () if agent.has_flattened else ("its losses have not flattened",)
            missing = (*agent.judge(self._networks(place, agent)).missing, *flat)
            complaints.append(f"agent {index + 1} of {len(self._learning) + len(self._passed)}: {'; '.join(missing)}")
        return f"after {self._settings.max_iterations} iterations, " + " | ".join(complaints)

    def _networks(self, place: int, agent: Apprentice) -> AgentNetworks:
        stacks = (self._policy.weights, self._model.weights)
        return agent.networks(*(unstack(weights, place, agent.encoding, self._common) for weights in stacks))

    def _explore(self) -> None:
        codes = torch.from_numpy(np.stack([agent.codes for agent in self._learning.values()]))
        with torch.no_grad():
            greedy = action_values(self._policy.weights, self._common.one_hot[codes]).argmax(dim=2).numpy()
        for agent, actions in zip(self._learning.values(), greedy, strict=True):
            agent.act(actions)

    def _improve_policies(self, rate: float) -> torch.Tensor:
        """Make one Double DQN update and return the mean losses `[A]` over even draws."""
        drawn = [agent.transitions() for agent in self._learning.values()]
        batch = _join([experience for experience, _ in drawn])
        pairs, one_hot = torch.from_numpy(batch.pairs), self._common.one_hot
        after = one_hot[torch.from_numpy(batch.next_codes)]
        with torch.no_grad():
            best = action_values(self._policy.weights, after).argmax(dim=2, keepdim=True)
            ahead = action_values(self._target, after).gather(2, best).squeeze(2)
            going = torch.from_numpy(~batch.terminated)
            targets = torch.from_numpy(batch.rewards) + self._settings.discount * ahead * going
        values = action_values(self._policy.weights, one_hot[pairs // NUM_ACTIONS])
        losses = (values.gather(2, (pairs % NUM_ACTIONS)[..., None]).squeeze(2) - targets).square()
        torch.autograd.backward(losses.mean(dim=1).sum())
        self._policy.step(rate)
        with torch.no_grad():
            for name, tensor in self._target.items():
                tensor.lerp_(self._policy.weights[name], self._settings.target_rate)
        self._note("policy", batch.pairs, losses.detach())
        return (losses.detach() * _evenness([evenness for _, evenness in drawn])).mean(dim=1)

    def _improve_models(self, rate: float) -> torch.Tensor:
        """Make one update of the world models and return the mean losses `[A]` over even draws."""
        drawn = [agent.sequences() for agent in self._learning.values()]
        sequences, singles = _join([draw[0] for draw in drawn]), _join([draw[1] for draw in drawn])
        inputs = self._common.one_hot_pairs
        keep = torch.from_numpy(~sequences.first).float()[..., None]
        logits = unroll(
            self._model.weights,
            inputs[torch.from_numpy(sequences.pairs)],
            keep,
            inputs[torch.from_numpy(singles.pairs)],
            self._settings.num_borrowed_queries,
        )
        of_sequences = self._cross_entropy(logits[0], _flat(sequences)).view(sequences.pairs.shape)
        of_singles = self._cross_entropy(logits[1], singles)
        per_draw = torch.cat((of_sequences.sum(dim=1), of_singles), dim=1)
        num_terms = of_sequences[0].numel() + of_singles.shape[1]
        torch.autograd.backward(per_draw.sum() / num_terms)
        self._model.step(rate)
        self._note("model", singles.pairs, of_singles.detach())
        return (per_draw.detach() * _evenness([draw[2] for draw in drawn])).sum(dim=1) / num_terms

    def _cross_entropy(self, logits: torch.Tensor, experience: Experience) -> torch.Tensor:
        """Return the losses `[A, N]` of logits `[A, N, num_outputs]`, summed over the components, in nats."""
        after = self._next_states[torch.from_numpy(experience.next_codes)]
        ends = torch.from_numpy(experience.terminated).long()[..., None]
        truth = torch.cat((after, ends), dim=2)
        masked = logits + self._mask
        losses = torch.zeros(logits.shape[:2])
        for component in range(NUM_COMPONENTS + 1):
            likelihoods = torch.log_softmax(masked[..., self._common.groups[component]], dim=2)
            losses = losses - likelihoods.gather(2, truth[..., component : component + 1]).squeeze(2)
        return losses

    def _note(self, network: NetworkName, pairs: Codes, losses: torch.Tensor) -> None:
        """Tell each agent its losses `[A, N]` on pairs `[A, N]`."""
        for agent, own_pairs, own_losses in zip(self._learning.values(), pairs, losses.numpy(), strict=True):
            agent.note(network, own_pairs, own_losses)


def _generator(seed: int, layout: Layout) -> torch.Generator:
    return torch.Generator().manual_seed(torch_seed(seed, "learning", str(layout), "weights"))


def _join(batches: Sequence[Experience]) -> Experience:
    """Stack the agents' transitions along a new first axis."""
    names = Experience.__slots__
    return Experience(**{name: np.stack([getattr(batch, name) for batch in batches]) for name in names})


def _evenness(rows: Sequence[NDArray[np.float64]]) -> torch.Tensor:
    return torch.from_numpy(np.stack(rows)).float()


def _flat(sequences: Experience) -> Experience:
    """Turn `[A, L, B]` into `[A, L * B]`."""
    names = Experience.__slots__
    return Experience(**{name: getattr(sequences, name).reshape(len(sequences.pairs), -1) for name in names})
