import random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from webapp.explainer.seeding import seed_sequence, stream, torch_seed

SEEDS = st.integers(0, 2**64)
PURPOSES = st.lists(st.text(st.characters(min_codepoint=32, codec="utf-8"), max_size=12), max_size=4).map(tuple)


@given(SEEDS, PURPOSES)
def test_a_stream_is_the_same_for_the_same_seed_and_purpose(seed: int, purpose: tuple[str, ...]) -> None:
    assert np.array_equal(stream(seed, *purpose).random(5), stream(seed, *purpose).random(5))
    assert torch_seed(seed, *purpose) == torch_seed(seed, *purpose)


@given(SEEDS, PURPOSES, SEEDS, PURPOSES)
def test_streams_of_different_seeds_or_purposes_differ(
    seed: int, purpose: tuple[str, ...], other_seed: int, other_purpose: tuple[str, ...]
) -> None:
    same = (seed, purpose or ("",)) == (other_seed, other_purpose or ("",))
    drawn, other = stream(seed, *purpose).random(3), stream(other_seed, *other_purpose).random(3)
    assert np.array_equal(drawn, other) == same
    assert (torch_seed(seed, *purpose) == torch_seed(other_seed, *other_purpose)) == same


def test_purposes_are_told_apart_by_where_one_name_ends() -> None:
    assert stream(0, "ab", "c").random() != stream(0, "a", "bc").random()


@given(SEEDS, PURPOSES)
def test_a_torch_seed_fits_in_63_bits(seed: int, purpose: tuple[str, ...]) -> None:
    assert 0 <= torch_seed(seed, *purpose) < 2**63


def test_streams_never_change_from_one_version_to_the_next() -> None:
    assert stream(0, "rollouts", "importance").integers(0, 1000, 5).tolist() == [905, 305, 546, 32, 178]
    assert torch_seed(7, "weights") == 4878992448732469694


def test_a_negative_seed_is_refused() -> None:
    for derive in (seed_sequence, stream, torch_seed):
        with pytest.raises(ValueError, match="0 or larger, not -1"):
            derive(-1, "rollouts")


def test_drawing_from_a_stream_leaves_global_randomness_alone() -> None:
    before = random.getstate(), str(np.random.get_state())  # noqa: NPY002 - The global state is what must not change.
    stream(3, "anything").random(100)
    assert (random.getstate(), str(np.random.get_state())) == before  # noqa: NPY002
