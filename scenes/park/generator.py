"""Parks by seed: another plan, other ground, trees, surfaces and light for each."""

from vobench.plugin import GeneratedPlace, park


def generate(seed: int, lighting: str) -> GeneratedPlace:
    """The park of a seed by day, in the evening, at night, or under an overcast sky."""
    return park.generated_park(seed, lighting).place()
