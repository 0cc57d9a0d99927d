"""Broad-leaved trees whose trunk divides into boughs and twigs, with small leaves on these. They stand on z = 0."""

from dataclasses import dataclass, replace

import numpy as np
from PIL import Image, ImageDraw

from vobench.asset import picture
from vobench.asset.furniture import Part, coated, matt, put
from vobench.asset.picture import Rng, one_of
from vobench.asset.shape import at, cards_arrays, lathe, tube_arrays
from vobench.geometry.se3 import Array
from vobench.geometry.vector import cross, unit
from vobench.scene.material import Material, Picture
from vobench.scene.mesh_arrays import MeshArrays, joined_arrays

BARKS = ("#6d5c4b", "#7d7264", "#5a4d40", "#8a8074")
LEAF_TINTS = ("#f4ffe4", "#e0f0c8", "#fff6d0", "#d2e6c4", "#f6e4b0")
CLEAR_M = 2.35  # below which there are no leaves and no branches
TRUNK_SHARE = 0.36  # of the height
TRUNK_RADIUS = 0.017  # relative to the height

# Branches of three levels: boughs, branches and twigs
LEVELS = 3
BOUGHS = 7  # around the one that continues the trunk
CHILDREN = (4, 3)  # branches that grow from a bough, and twigs that grow from a branch
SECTIONS = (7, 5, 3)  # sides of a branch of each level
TIP_RADIUS = 0.55  # of a branch, relative to its base

# Cards with a spray of leaves
SPRAYS_PER_TWIG = 5
SPRAY_M = 0.62  # side of a card; its leaves are about 5 cm long
HALF_DIAGONAL = 0.71  # of a card, relative to its side: it reaches no further in any pose

# The picture of a spray
LEAVES = 170
TRANSPARENT = (92, 116, 54, 0)

TUB_COLOURS = ("#8a5a44", "#4c4f50", "#b9b3a6", "#2f4a36")
TUB_SPRAYS = 16


@dataclass(frozen=True, slots=True, eq=False)
class _Branch:
    """A branch from a base along a direction; level 0 is a bough."""

    base_m: Array
    direction: Array
    length_m: float
    radius_m: float
    level: int


def branching_tree(rng: Rng, height_m: float = 6.5, spread: float = 0.36, density: float = 1.0) -> list[Part]:
    """A tree with a clear trunk.

    `spread` is the radius of the crown relative to the height.
    `density` is the share of twigs with all their sprays; the others have one less.
    """
    bark = matt(one_of(rng, *BARKS), picture.boards("walnut", 3, 512, 0.8))
    lean = rng.normal(0, 0.025, 2)
    trunk_m = max(TRUNK_SHARE * height_m, CLEAR_M + 0.2)
    radius_m = TRUNK_RADIUS * height_m
    top_m = np.array([*(lean * height_m), trunk_m])
    foot_m = np.array([0.0, 0.0, -0.05])
    wood = [_tapered(foot_m, top_m, radius_m * 1.35, radius_m, sections=10)]

    twigs: list[_Branch] = []
    to_grow = _boughs(rng, top_m, height_m, spread, radius_m)
    while to_grow:
        branch = to_grow.pop()
        end_m = branch.base_m + branch.length_m * branch.direction
        end_m[2] = max(end_m[2], CLEAR_M)
        tip_radius_m = TIP_RADIUS * branch.radius_m
        sections = SECTIONS[branch.level]
        wood.append(_tapered(branch.base_m, end_m, branch.radius_m, tip_radius_m, sections=sections))
        is_twig = branch.level == LEVELS - 1
        if is_twig:
            twigs.append(branch)
        else:
            to_grow += _children(rng, branch, end_m)
    return [Part(joined_arrays(wood), bark), Part(_sprays(rng, twigs, density), _leaves(rng))]


def _tapered(
    start_m: Array,
    end_m: Array,
    start_radius_m: float,
    end_radius_m: float,
    *,
    sections: int,
) -> MeshArrays:
    """A rod that tapers: one of radius 1 whose rings are scaled towards its axis."""
    rod = tube_arrays(np.stack([start_m, end_m]), 1.0, sections=sections)
    axis = end_m - start_m
    share = np.clip((rod.vertices_m - start_m) @ axis / (axis @ axis), 0, 1)[:, None]  # along the axis
    on_axis_m = start_m + share * axis
    radius_m = start_radius_m + share * (end_radius_m - start_radius_m)
    return replace(rod, vertices_m=on_axis_m + radius_m * (rod.vertices_m - on_axis_m))


def _boughs(rng: Rng, top_m: Array, height_m: float, spread: float, radius_m: float) -> list[_Branch]:
    """The boughs at the top of the trunk: one upwards, and the others around it."""
    crown_m = height_m - top_m[2]
    upwards = unit(np.array([*rng.normal(0, 0.12, 2), 1.0]))
    boughs = [_Branch(top_m, upwards, 0.42 * crown_m, 0.75 * radius_m, level=0)]
    first_rad = rng.uniform(0, 2 * np.pi)
    for index in range(BOUGHS):
        azimuth_rad = first_rad + 2 * np.pi * index / BOUGHS + rng.normal(0, 0.2)
        steepness = rng.uniform(0.45, 1.7)
        direction = unit(np.array([np.cos(azimuth_rad), np.sin(azimuth_rad), steepness]))
        base_m = top_m - [0, 0, rng.uniform(0, 0.2)]
        length_m = spread * height_m * rng.uniform(0.5, 0.68)
        boughs.append(_Branch(base_m, direction, length_m, 0.55 * radius_m, level=0))
    return boughs


def _children(rng: Rng, parent: _Branch, end_m: Array) -> list[_Branch]:
    """The branches that grow from the outer half of a branch, and its continuation."""
    children = []
    for index in range(CHILDREN[parent.level]):
        continues_parent = index == 0
        share = 1.0 if continues_parent else rng.uniform(0.45, 0.95)  # of the parent's length
        base_m = parent.base_m + share * (end_m - parent.base_m)
        sideways = unit(cross(parent.direction, unit(rng.standard_normal(3))))
        bend = 0.25 if continues_parent else rng.uniform(0.55, 1.0)
        direction = unit(parent.direction + bend * sideways + [0, 0, 0.1])
        length_m = parent.length_m * rng.uniform(0.5, 0.72)
        children.append(_Branch(base_m, direction, length_m, 0.5 * parent.radius_m, parent.level + 1))
    return children


def _sprays(rng: Rng, twigs: list[_Branch], density: float) -> MeshArrays:
    """Cards with leaves along the outer part of each twig."""
    sizes_m = []
    poses = []
    for twig in twigs:
        count = SPRAYS_PER_TWIG if rng.random() < density else SPRAYS_PER_TWIG - 1
        for _ in range(count):
            along_m = rng.uniform(0.3, 1.15) * twig.length_m
            place_m = twig.base_m + along_m * twig.direction + rng.normal(0, 0.16, 3)
            side_m = SPRAY_M * rng.uniform(0.8, 1.25)
            place_m[2] = max(place_m[2], CLEAR_M + HALF_DIAGONAL * side_m)
            yaw_deg = float(rng.uniform(0, 360))
            pitch_deg = float(rng.uniform(-75, -10))
            roll_deg = float(rng.uniform(0, 360))
            sizes_m.append((side_m, side_m))
            poses.append(at(*place_m.tolist(), yaw=yaw_deg, pitch=pitch_deg, roll=roll_deg))
    return cards_arrays(sizes_m, poses)


def tub_plant(rng: Rng, height_m: float = 1.0) -> list[Part]:
    """A bush of small leaves in a tub."""
    tub_m = 0.36 * height_m
    radius_m = 0.2 * height_m
    profile = np.array([[0, 0], [0.75 * radius_m, 0], [radius_m, tub_m], [0.9 * radius_m, tub_m], [0, 0.9 * tub_m]])
    tub = coated(one_of(rng, *TUB_COLOURS), roughness=0.4)
    middle_m = np.array([0, 0, 0.68 * height_m])  # of the bush
    sizes_m = []
    poses = []
    for _ in range(TUB_SPRAYS):
        outward = unit(rng.standard_normal(3))
        place_m = middle_m + 0.24 * height_m * outward * rng.uniform(0.2, 0.9)
        side_m = 0.32 * height_m * rng.uniform(0.8, 1.2)
        yaw_deg, pitch_deg, roll_deg = rng.uniform([0, -70, 0], [360, -10, 360]).tolist()
        sizes_m.append((side_m, side_m))
        poses.append(at(*place_m.tolist(), yaw=yaw_deg, pitch=pitch_deg, roll=roll_deg))
    return [put(lathe(profile, sections=14), tub), Part(cards_arrays(sizes_m, poses), _leaves(rng))]


def _leaves(rng: Rng) -> Material:
    """Leaves cut out of a picture of a spray, in one of some tints."""
    tint = one_of(rng, *LEAF_TINTS)
    texture = spray(int(rng.integers(3)))
    return replace(matt(tint, texture), cutout=0.5, is_foliage=True)


@picture.painted
def spray(seed: int = 0, px: int = 512) -> Picture:
    """Small leaves on a transparent background, from dark ones at the back to light ones at the front."""
    rng = np.random.default_rng([seed, 31])
    image = Image.new("RGBA", (px, px), TRANSPARENT)
    draw = ImageDraw.Draw(image)
    angle_rad = np.linspace(0, 2 * np.pi, 11)[:, None]  # around the outline of a leaf
    for index in range(LEAVES):
        radius_px = px * 0.45 * np.sqrt(rng.random())
        bearing_rad = rng.uniform(0, 2 * np.pi)
        middle_px = px / 2 + radius_px * np.array([np.cos(bearing_rad), np.sin(bearing_rad)])

        heading_rad = bearing_rad + rng.normal(0, 0.9)
        half_length_px = px * rng.uniform(0.032, 0.05)
        ahead = np.array([np.cos(heading_rad), np.sin(heading_rad)])
        across = np.array([-ahead[1], ahead[0]])
        taper = 1 - 0.35 * np.cos(angle_rad)  # narrower towards the tip
        lengthwise = np.cos(angle_rad) * ahead
        crosswise = 0.42 * np.sin(angle_rad) * taper * across
        outline_px = middle_px + half_length_px * (lengthwise + crosswise)

        tone = 0.62 + 0.5 * index / LEAVES + rng.normal(0, 0.07)
        colour = (126 + rng.normal(0, 16), 158 + rng.normal(0, 6), 70)
        red, green, blue = (int(np.clip(channel * tone, 0, 255)) for channel in colour)
        draw.polygon([tuple(point) for point in outline_px.tolist()], fill=(red, green, blue, 255))
    return Picture(np.asarray(image))
