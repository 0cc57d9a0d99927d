"""Flats by seed: another plan, other furniture, surfaces and light for each."""

from vobench.plugin import GeneratedPlace, home


def generate(seed: int, lighting: str) -> GeneratedPlace:
    """The flat of a seed by day, in the evening, at night, or under an overcast sky."""
    return home.furnished_flat(seed, lighting).place()
