"""Random streams by name: each process draws from its own, so that one factor is one change."""

import hashlib

import numpy as np


def generator(seed: int, stream: str) -> np.random.Generator:
    """The random stream of that name: no other stream, and nothing else in a case, changes its draws."""
    name = int.from_bytes(hashlib.sha256(stream.encode()).digest()[:8], "big")
    return np.random.default_rng([seed, name])
