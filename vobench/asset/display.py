"""Televisions, monitors and laptops, switched on or off."""

from collections.abc import Sequence
from dataclasses import replace

from vobench.asset import furniture, household, office
from vobench.asset.furniture import Part, coated
from vobench.asset.picture import Rng

TELEVISIONS_ON = 0.35  # the share that is switched on


def television(rng: Rng, width_m: float, seed: int) -> list[Part]:
    """A television, mostly switched off."""
    parts = household.television(rng, width_m=width_m, seed=seed)
    is_on = rng.random() < TELEVISIONS_ON
    return parts if is_on else switched_off(parts)


def monitor(rng: Rng, width_m: float, seed: int, *, is_on: bool) -> list[Part]:
    """A monitor on a foot."""
    parts = furniture.monitor(rng, width_m=width_m, seed=seed)
    return parts if is_on else switched_off(parts)


def laptop_off(rng: Rng, seed: int) -> list[Part]:
    """A laptop whose display is off."""
    return switched_off(office.laptop(rng, seed))


def switched_off(parts: Sequence[Part]) -> list[Part]:
    """The parts of a display with dark glass in place of its picture.

    Every display that shines is a lamp, whose light takes time to compute.
    """
    dark_glass = coated("#141618", roughness=0.08)
    return [replace(part, material=dark_glass) if part.material.emission_texture else part for part in parts]
