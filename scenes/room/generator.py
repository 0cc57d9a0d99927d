"""Variants of the paper's room by seed: another plan, other furniture, surfaces and light for each."""

from vobench.plugin import GeneratedPlace, paper_room


def generate(seed: int, lighting: str) -> GeneratedPlace:
    """The room of a seed by day, in the evening, at night, or under an overcast sky. Its lamps are on."""
    return paper_room.generated_paper_room(seed, lighting).place()
