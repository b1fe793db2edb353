"""Where a walker goes next, ready to be drawn: one urn of next states per state."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from webapp.explainer.stochastic import StochasticMDP

_MOST_TOKENS = 64
"""An urn holds at most so many equally likely tokens; chances that need more are drawn with a second draw."""
_LARGEST_TABLE = 1 << 24
"""So many tokens may all even urns hold together."""
_ROUNDING = 1e-12
"""A chance this close to a whole number of tokens is one."""


@dataclass(frozen=True, slots=True, eq=False)
class Urns:
    """`R` urns. A token of an urn is drawn uniformly; with its chance `keep` it counts itself, else `other` does.

    This is the alias method (Walker 1977, Vose 1991): one draw takes the same time from an urn of any size. Urns are
    even where every token counts itself and all hold the same number of them: then one whole number is drawn.

    Attributes:
        row_start: `[R + 1]`, where the tokens of each urn begin, from 0 to N.
        token: `[N]` state indices.
        keep: `[N]` in [0, 1], or None where the urns are even.
        other: `[N]` state indices.
    """

    row_start: NDArray[np.int64]
    token: NDArray[np.int32]
    keep: NDArray[np.float64] | None
    other: NDArray[np.int32]

    @property
    def width(self) -> int | None:
        """How many tokens each even urn holds; None where the urns are not even."""
        return len(self.token) // (len(self.row_start) - 1) if self.keep is None else None


def fill_urns(mdp: StochasticMDP, states: NDArray[np.int64], weights: NDArray[np.float64]) -> Urns:
    """Return an urn for each of some states whose action is chosen by chance.

    Args:
        mdp: The world.
        states: `[R]` state indices, in any order, also repeated.
        weights: `[R, A]`: the probability of each action. In a row of zeros no action is taken and the state stays.
    """
    row_start, token, chance = _outcomes(mdp, states, weights)
    copies = _even_copies(row_start, chance)
    if copies is not None:
        token = np.repeat(token, copies)
        width = len(token) // len(states)
        return Urns(np.arange(len(states) + 1) * width, token, None, token)
    keep, partner = _alias(row_start, chance)
    return Urns(row_start, token, keep, token[partner])


def side_by_side(urns: Urns, num_copies: int) -> Urns:
    """Return the urns of as many copies of a world, whose states are numbered on: `[c * S + s]` is `s` in copy `c`.

    Args:
        urns: One for each state of the first copy, then one for each of the second, all naming states of the first.
        num_copies: How many.
    """
    num_states = (len(urns.row_start) - 1) // num_copies
    first = np.repeat(np.arange(num_copies, dtype=np.int32) * num_states, np.diff(urns.row_start[::num_states]))
    return Urns(urns.row_start, urns.token + first, urns.keep, urns.other + first)


def uniform(allowed: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Return `[R, A]` equal chances of the allowed actions `[R, A]`; a row without any is left at zeros."""
    counts = allowed.sum(axis=1, keepdims=True)
    weights: NDArray[np.float64] = allowed / np.maximum(counts, 1)
    return weights


def _outcomes(
    mdp: StochasticMDP, states: NDArray[np.int64], weights: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.float64]]:
    """Return row starts `[R + 1]`, next states `[N]` and their chances `[N]`."""
    rows, actions = np.nonzero(weights)
    pairs = states[rows] * mdp.num_actions + actions
    counts = np.diff(mdp.row_start)[pairs]
    entries = np.repeat(mdp.row_start[pairs] - np.cumsum(counts) + counts, counts) + np.arange(counts.sum())
    stays = np.flatnonzero(~weights.any(axis=1))
    row = np.concatenate((np.repeat(rows, counts), stays))
    token = np.concatenate((mdp.next_state[entries], states[stays])).astype(np.int32)
    chance = np.concatenate((np.repeat(weights[rows, actions], counts) * mdp.probability[entries], np.ones(len(stays))))
    order = np.argsort(row, kind="stable")
    row_start = np.searchsorted(row[order], np.arange(len(states) + 1)).astype(np.int64)
    return row_start, token[order], chance[order]


def _even_copies(row_start: NDArray[np.int64], chance: NDArray[np.float64]) -> NDArray[np.int64] | None:
    """Return `[N]`: how many equal tokens stand for each outcome, or None where there is no such number."""
    distinct = np.unique(chance)
    num_rows = len(row_start) - 1
    if not num_rows or len(distinct) > _MOST_TOKENS**2:
        return None
    for width in range(1, min(_MOST_TOKENS, _LARGEST_TABLE // num_rows) + 1):
        tokens = distinct * width
        if np.all(np.abs(tokens - np.round(tokens)) <= _ROUNDING * width):
            copies = np.round(chance * width).astype(np.int64)
            return copies if np.all(np.add.reduceat(copies, row_start[:-1]) == width) else None
    return None


def _alias(row_start: NDArray[np.int64], chance: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return how likely each token counts itself, and the place of the token that counts otherwise.

    In each urn the rarest token that is left is filled up from the most frequent one until every token holds its share.
    """
    keep, partner = np.ones(len(chance)), np.arange(len(chance))
    sizes = np.diff(row_start)
    for size in np.unique(sizes):
        places = row_start[:-1][sizes == size][:, None] + np.arange(size)
        level = chance[places]
        level *= size / level.sum(axis=1, keepdims=True)
        left, every = np.ones_like(level, dtype=np.bool_), np.arange(len(places))
        for _ in range(size - 1):
            rare = np.where(left, level, np.inf).argmin(axis=1)
            frequent = np.where(left, level, -np.inf).argmax(axis=1)
            keep[places[every, rare]] = np.clip(level[every, rare], 0.0, 1.0)
            partner[places[every, rare]] = places[every, frequent]
            left[every, rare] = False
            level[every, frequent] -= np.maximum(1 - level[every, rare], 0.0)
    return keep, partner
