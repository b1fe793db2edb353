"""Randomness as an argument: one named, independent stream per purpose, all derived from one seed."""

import hashlib

import numpy as np


def seed_sequence(seed: int, *purpose: str) -> np.random.SeedSequence:
    """Derive the seed sequence of one purpose.

    Streams of different purposes are independent, and adding a purpose changes no other stream.

    Args:
        seed: The study's or the command's seed, at least 0.
        purpose: Names that identify the stream, from general to particular, such as `("rollouts", "importance")`.

    Raises:
        ValueError: The seed is negative.
    """
    if seed < 0:
        raise ValueError(f"the seed must be 0 or larger, not {seed}")
    digest = hashlib.sha256("\x1f".join(purpose).encode()).digest()
    words = [int.from_bytes(digest[i : i + 4], "little") for i in range(0, 16, 4)]
    return np.random.SeedSequence([seed, *words])


def stream(seed: int, *purpose: str) -> np.random.Generator:
    """Return the NumPy generator of one purpose; see `seed_sequence`."""
    return np.random.Generator(np.random.PCG64(seed_sequence(seed, *purpose)))


def torch_seed(seed: int, *purpose: str) -> int:
    """Return the 63-bit seed of one purpose, for a `torch.Generator` (made where torch is allowed)."""
    return int(seed_sequence(seed, *purpose).generate_state(1, np.uint64)[0] >> np.uint64(1))
