"""Streets by seed: another plan, other houses, cars, trees and light for each."""

from vobench.plugin import GeneratedPlace, street


def generate(seed: int, lighting: str) -> GeneratedPlace:
    """The street of a seed by day, in the evening, at night, or under an overcast sky."""
    return street.generated_street(seed, lighting).place()
