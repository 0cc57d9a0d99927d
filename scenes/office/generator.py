"""Offices by seed: another plan, other furniture, surfaces and light for each."""

from vobench.plugin import GeneratedPlace, workplace


def generate(seed: int, lighting: str) -> GeneratedPlace:
    """The office of a seed by day, in the evening, at night, or under an overcast sky."""
    return workplace.furnished_office(seed, lighting).place()
