"""Plants in pots, of several kinds, with few faces. They stand on z = 0."""

from typing import Literal, NamedTuple

import numpy as np

from vobench.asset import picture
from vobench.asset.furniture import Part, coated, matt, mm, put
from vobench.asset.picture import Rng, one_of
from vobench.asset.shape import at, lathe, sheet_arrays, tube_arrays
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays

Habit = Literal["broad", "upright", "tree", "trailing"]
HABITS: tuple[Habit, ...] = ("broad", "upright", "tree", "trailing")
REACH = 0.36  # of a plant from its middle, relative to its height
GOLDEN_ANGLE_DEG = 137.5  # between a leaf and the next one around the stem
POT_COLOURS = ("", "", "#e6e2d8", "#3a3c3e", "#7f9182", "#46586a", "#c9a271")  # "" is clay
GREENS = ("#e8f0d8", "#cfe0c0", "#dfe8b8", "#c0d0b8")
POT_PROFILES = (  # in thousandths of the height: distance from the axis, height
    "0 0, 360 0, 480 920, 520 930, 520 1000, 460 1000, 440 850, 0 860",
    "0 0, 420 0, 440 40, 440 1000, 400 1000, 395 860, 0 865",
    "0 0, 300 0, 470 300, 480 700, 400 1000, 365 1000, 380 850, 0 860",
)


def houseplant(rng: Rng, height_m: float = 1.0, habit: Habit = "broad", pot: str = "") -> list[Part]:
    """A plant `height_m` high in a pot of clay, or glazed in a colour.

    It reaches no further than REACH from its middle.
    """
    pot_m = min(0.3 * height_m, 0.34)
    leaf = coated(one_of(rng, *GREENS), picture.ground("leaf", 0, 512, 0.4), roughness=0.35)
    plant = _plant(rng, height_m, pot_m, habit)
    blades = joined_arrays([blade.two_sided() for blade in plant.blades])
    parts = [*_pot(rng, pot_m, pot), Part(blades, leaf)]
    if plant.stems:
        bark = "#6a5238" if habit == "tree" else "#4b5a2e"
        parts.append(Part(joined_arrays(plant.stems), matt(bark)))
    return _within_reach(parts, height_m)


class _Plant(NamedTuple):
    """The stems and the leaf blades of a plant."""

    stems: list[MeshArrays]
    blades: list[MeshArrays]


def _plant(rng: Rng, height_m: float, pot_m: float, habit: Habit) -> _Plant:
    """A plant that grows in a pot `pot_m` high."""
    if habit == "upright":
        return _Plant([], _upright_blades(rng, height_m, pot_m))
    if habit == "tree":
        return _tree(rng, height_m, pot_m)
    return _leaves_on_stems(rng, height_m, pot_m, is_trailing=habit == "trailing")


def _within_reach(parts: list[Part], height_m: float) -> list[Part]:
    """The parts, made narrower if leaves reach further from the middle than REACH."""
    reaches_m = [np.linalg.norm(part.arrays.vertices_m[:, :2], axis=1).max() for part in parts]
    width_factor = min(1.0, REACH * height_m / float(max(reaches_m)))
    return [part.moved(np.diag([width_factor, width_factor, 1.0, 1.0])) for part in parts]


def _pot(rng: Rng, pot_m: float, colour: str) -> list[Part]:
    """A pot of one of three profiles, with soil."""
    profile = POT_PROFILES[int(rng.integers(len(POT_PROFILES)))]
    clay = matt(texture=picture.ground("clay", 0, 512, 0.6))
    surface = coated(colour, roughness=0.15) if colour else clay
    body = lathe(mm(profile) * pot_m, sections=16)
    soil = lathe(mm("0 800, 380 868, 0 900") * pot_m, sections=12)
    return [put(body, surface), put(soil, matt("#3a2c22"))]


def _blade(length_m: float, width_m: float, *, drop: float, fold: float) -> MeshArrays:
    """A leaf from the origin along x, which rises and bends down, folded along its middle.

    `drop` is the fall of its tip relative to its length, and `fold` the slope of its halves.
    """
    along = np.linspace(0, 1, 5)[:, None]
    half_width_m = width_m / 2 * np.sin(np.pi * along**0.7) + 0.0006
    y = half_width_m * np.array([1, 0, -1])
    x = length_m * along + 0 * y
    z = length_m * (0.3 * along - drop * along**2) + fold * np.abs(y)
    return sheet_arrays(np.stack([x, y, z], axis=-1))


def _upright_blades(rng: Rng, height_m: float, pot_m: float) -> list[MeshArrays]:
    """Stiff leaves that rise from the soil."""
    soil_m = 0.85 * pot_m
    blades = []
    for _ in range(int(rng.integers(9, 15))):
        length_m = rng.uniform(0.55, 1.0) * (height_m - soil_m)
        blade = _blade(length_m, 0.11 * length_m + 0.02, drop=0.18, fold=0.3)
        yaw_deg = rng.uniform(0, 360)
        lean_deg = rng.uniform(64, 84)
        radius_m = 0.25 * pot_m * np.sqrt(rng.random())  # evenly spread over the soil
        T_pot_blade = at(yaw=yaw_deg) @ at(radius_m, 0, soil_m, pitch=-lean_deg + 14)
        blades.append(blade.moved(T_pot_blade))
    return blades


def _leaves_on_stems(rng: Rng, height_m: float, pot_m: float, *, is_trailing: bool) -> _Plant:
    """Leaves on bent stems, which hang over the pot if the plant trails."""
    stems = []
    blades = []
    soil_m = 0.85 * pot_m
    count = int(rng.integers(13, 18))
    for index in range(count):
        T_pot_leaf = at(yaw=GOLDEN_ANGLE_DEG * index + rng.uniform(-15, 15))
        rise_m = rng.uniform(0.4, 0.9) * height_m
        reach_m = rng.uniform(0.03, 0.14) * height_m
        length_m = rng.uniform(0.14, 0.21) * height_m
        if is_trailing:
            rise_m = rng.uniform(0.75, 1.0) * pot_m + rng.uniform(0, 0.25) * height_m
            reach_m = rng.uniform(0.3, 0.8) * pot_m

        start_m = [0.0, 0.0, soil_m]
        middle_m = [0.35 * reach_m, 0.0, 0.6 * rise_m + 0.4 * 0.85 * pot_m]
        end_m = [reach_m, 0.0, rise_m]
        stem = tube_arrays(np.array([start_m, middle_m, end_m]), 0.003 * height_m + 0.0006, sections=3)
        width_m = rng.uniform(0.4, 0.6) * length_m
        blade = _blade(length_m, width_m, drop=rng.uniform(0.1, 0.8), fold=0.25)
        stems.append(stem.moved(T_pot_leaf))
        blades.append(blade.moved(T_pot_leaf @ at(*end_m)))
    return _Plant(stems, blades)


def _tree(rng: Rng, height_m: float, pot_m: float) -> _Plant:
    """A trunk with a crown of small leaves on twigs."""
    bend_m = rng.uniform(-0.03, 0.03, 2) * height_m
    trunk_m = [[0, 0, 0.8 * pot_m], [*bend_m, 0.5 * height_m], [*(1.4 * bend_m), 0.78 * height_m]]
    stems = [tube_arrays(np.array(trunk_m, float), 0.012 * height_m + 0.004, sections=6)]
    blades = []
    for index in range(8):
        yaw_deg = GOLDEN_ANGLE_DEG * index + rng.uniform(-20, 20)
        start_m = rng.uniform(0.48, 0.76) * height_m
        reach_m = rng.uniform(0.1, 0.19) * height_m
        rise_m = rng.uniform(0.02, 0.16) * height_m
        T_pot_twig = at(float(bend_m[0]), float(bend_m[1]), start_m, yaw=yaw_deg)
        twig = tube_arrays(np.array([[0, 0, 0], [reach_m, 0, rise_m]]), 0.004 * height_m + 0.001, sections=3)
        stems.append(twig.moved(T_pot_twig))
        for share in (0.45, 0.75, 1.0):
            length_m = rng.uniform(0.09, 0.13) * height_m
            blade = _blade(length_m, 0.45 * length_m, drop=rng.uniform(0.2, 0.7), fold=0.2)
            T_twig_leaf = at(share * reach_m, 0, share * rise_m, yaw=rng.uniform(-80, 80))
            blades.append(blade.moved(T_pot_twig @ T_twig_leaf))
    return _Plant(stems, blades)
