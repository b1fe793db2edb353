"""Rival ways of choosing the steps that an explanation shows, each for a budget of k steps.

Every selector returns exactly as many different steps of the path as it is asked for, from 1 to T and ascending, so
that they can be compared at an equal budget. None of them draws at random but `random_pair_steps`, and `bottlenecks`
where the world is too large for an exact answer.
"""

from webapp.explainer.selectors.baselines import evenly_spaced_steps, random_pair_steps
from webapp.explainer.selectors.bottlenecks import betweenness, bottlenecks, local_maxima
from webapp.explainer.selectors.highlights import context_frames, highlights, highlights_steps, q_gaps
from webapp.explainer.selectors.landmarks import (
    fact_in_words,
    landmark_facts,
    landmark_states,
    landmarks,
    landmarks_by_fact,
)
from webapp.explainer.selectors.ranking import Ready, most_important_steps

__all__ = [
    "Ready",
    "betweenness",
    "bottlenecks",
    "context_frames",
    "evenly_spaced_steps",
    "fact_in_words",
    "highlights",
    "highlights_steps",
    "landmark_facts",
    "landmark_states",
    "landmarks",
    "landmarks_by_fact",
    "local_maxima",
    "most_important_steps",
    "q_gaps",
    "random_pair_steps",
]
