"""The covariates of the planned model: its columns, what cannot be told apart, kinds without an estimate."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from webapp.analysis.independent_columns import independent
from webapp.analysis.links import Array

FACTORS = ("kind", "layout", "position")


def kinds_at_an_end(frame: pd.DataFrame, kinds: Sequence[str]) -> Mapping[str, str]:
    """Return the kinds of which no rating lies within those of the others, each with the reason in words.

    The likelihood grows for ever with the effect of a kind whose every rating is at least as high as each of the
    others, or as low. Without it another may be the highest one, so the search goes on until one kind is left.

    Args:
        frame: The ratings, with `kind` and `rating`.
        kinds: The kinds to look at.
    """
    found: dict[str, str] = {}
    ends = frame.groupby("kind")["rating"].agg(["min", "max"])
    while (words := _next_at_an_end(ends.drop(index=list(found)), kinds)) is not None:
        found |= words
    return found


def _next_at_an_end(ends: pd.DataFrame, kinds: Sequence[str]) -> dict[str, str] | None:
    for kind in (kind for kind in kinds if kind in ends.index and len(ends) > 1):
        least, most = (int(ends.loc[kind, end]) for end in ("min", "max"))
        others = ends.drop(index=kind)
        above, below = int(others["max"].max()), int(others["min"].min())
        if above <= least and below < most:
            told = f"every rating of {kind} is {least} or higher, every other one {above} or lower"
        elif most <= below and least < above:
            told = f"every rating of {kind} is {most} or lower, every other one {below} or higher"
        else:
            continue
        return {kind: f"{told}; a difference from it has no finite estimate, and only the rank tests compare it"}
    return None


def weights_of_kinds(kinds: Sequence[str], names: Sequence[str], columns: Sequence[str]) -> dict[str, Array]:
    """Return for each kind its covariates as `[P]` weights; a kind that cannot be told from the rest has none."""
    places = {name.removeprefix("kind "): place for place, name in enumerate(names) if columns[place] == "kind"}
    weights = {kind: np.zeros(len(names)) for kind in kinds if kind == kinds[0] or kind in places}
    for kind, place in places.items():
        weights[kind][place] = 1.0
    return weights


def covariates_of(
    frame: pd.DataFrame, kinds: Sequence[str]
) -> tuple[Array, tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """Return covariates, their names, their factors, and what was left out; kinds come first, so they stay longest."""
    columns = [
        (f"{factor} {level}", factor, (frame[factor] == level).to_numpy(dtype=np.float64))
        for factor in FACTORS
        for level in (list(kinds) if factor == "kind" else sorted(frame[factor].unique()))[1:]
    ]
    found = independent(columns, len(frame))
    lost: dict[str, list[str]] = {}
    for column in found.lost:
        lost.setdefault(column.factor, []).append(column.name.removeprefix(f"{column.factor} "))
    aliased = tuple(
        f"{factor} {', '.join(levels)} cannot be told from {_others(factor)} in this design"
        for factor, levels in lost.items()
    )
    names, factors = ([getattr(column, of) for column in found.kept] for of in ("name", "factor"))
    return found.x, tuple(names), tuple(factors), aliased


def _others(factor: str) -> str:
    return {"kind": "the constant", "layout": "the kinds", "position": "kinds and layouts"}[factor]
