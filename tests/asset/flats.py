"""Flats by day, each built once in a process."""

from functools import cache

from vobench.asset.home import furnished_flat
from vobench.asset.interior import Interior

SEEDS = range(1, 13)


@cache
def flat(seed: int) -> Interior:
    return furnished_flat(seed, "day")
