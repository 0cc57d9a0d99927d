"""Warehouses by seed: another plan, other racks, goods, surfaces and light for each."""

from vobench.plugin import GeneratedPlace, warehouse


def generate(seed: int, lighting: str) -> GeneratedPlace:
    """The warehouse of a seed by day, in the evening, at night, or under an overcast sky."""
    return warehouse.generated_warehouse(seed, lighting).place()
