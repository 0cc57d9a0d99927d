"""The leaves of trees in wind: groups of faces, each of which turns about the base of its branch as a rigid body."""

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial.transform import Rotation

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.scene.scene import Mover, Scene
from vobench.scene.triangles import Triangles
from vobench.scene.weld import WELD_M, welded
from vobench.scene.wind import Sway, branch_sways

SECTORS = 3  # of a tier of a crown, around the trunk
TIER_M = 3.0  # the height of a tier of a crown, about; a crown of one tier is not divided into sectors
UP = np.array([0.0, 0.0, 1.0])

Rows = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class SwayMotion:
    """The motion of leaves that turn about the base (3,) of their branch; without wind, their frame is the world.

    `towards` (3,) is the direction of the wind.
    """

    base_m: Array
    towards: Array
    sway: Sway

    def pose(self, t_ns: float) -> Array:
        """T_world_mover (4, 4) at an instant."""
        along_rad, across_rad = self.sway.at(t_ns)
        # A rotation about `aside` turns what is above the base towards the wind's direction.
        aside = np.cross(UP, self.towards)
        R = Rotation.from_rotvec(along_rad * aside - across_rad * self.towards).as_matrix()
        return se3.transform(R, self.base_m - R @ self.base_m)

    def sized(self, by: float) -> "SwayMotion":
        """The same with all lengths times `by`."""
        return replace(self, base_m=self.base_m * by)


@dataclass(frozen=True, slots=True)
class InWind:
    """The faces of a scene and its movers, among which are groups of leaves if there is wind.

    The groups follow the movers of the scene. Their things are among the stationary things of the scene.
    """

    faces: Triangles
    movers: tuple[Mover, ...]


def in_wind(scene: Scene, faces: Triangles) -> InWind:
    """The faces of a scene, in the frames of their movers, with the leaves that its wind moves as movers."""
    if scene.wind is None or scene.wind.speed_mps == 0:
        return InWind(faces, scene.movers)
    movers = list(scene.movers)
    mover = faces.mover.copy()
    for index, thing in enumerate(faces.things):
        material = scene.materials.get(thing.material)
        rows = np.flatnonzero((faces.thing == index) & (faces.mover < 0))
        if material is None or not material.is_foliage or not len(rows):
            continue
        crown = _crown(faces.corners_m[rows])
        mover[rows] = len(movers) + crown.branch
        sways = branch_sways(
            scene.wind,
            tree=index,
            place_m=crown.bases_m[0],
            height_m=_height_m(faces, thing.name),
            branches=len(crown.bases_m),
        )
        for base_m, sway in zip(crown.bases_m, sways, strict=True):
            movers.append(Mover(thing.name, (), SwayMotion(base_m, scene.wind.towards, sway)))
    return InWind(replace(faces, mover=mover), tuple(movers))


@dataclass(frozen=True, slots=True)
class _Crown:
    """The leaves of a tree: the branch (F,) of each face, and the base (B, 3) of each branch."""

    branch: Rows
    bases_m: Array


def _crown(corners_m: Array) -> _Crown:
    """Divide leaves (F, 3, 3) into branches: sectors around the trunk, in tiers. A spray of leaves is not divided.

    The base of a branch is on the axis of the crown, as high as the lowest leaves of the branch.
    """
    spray = _sprays(corners_m)
    count = np.bincount(spray)
    middles_m = np.stack([np.bincount(spray, column) / count for column in corners_m.mean(1).T], -1)  # of sprays
    axis_m = middles_m[:, :2].mean(0)
    low_m = middles_m[:, 2].min()
    tiers = max(1, math.ceil(np.ptp(middles_m[:, 2]) / TIER_M))
    tier_share = (middles_m[:, 2] - low_m) / max(float(np.ptp(middles_m[:, 2])), WELD_M)
    tier = np.minimum((tiers * tier_share).astype(np.int64), tiers - 1)
    offset_m = middles_m[:, :2] - axis_m
    turn = np.arctan2(offset_m[:, 1], offset_m[:, 0]) / (2 * np.pi) + 0.5
    sectors = SECTORS if tiers > 1 else 1
    sector = (sectors * turn).astype(np.int64) % sectors

    _, branch_of_spray = np.unique(sectors * tier + sector, return_inverse=True)
    branch = branch_of_spray[spray]
    bases_m = []
    for index in range(branch.max() + 1):
        lowest_m = corners_m[branch == index, :, 2].min()
        bases_m.append([*axis_m, lowest_m])
    return _Crown(branch, np.array(bases_m))


def _sprays(corners_m: Array) -> Rows:
    """The spray (F,) of each face (F, 3, 3): faces with common corners are one spray."""
    corner = welded(corners_m.reshape(-1, 3)).inverse.reshape(-1, 3)
    corner_count = int(corner.max()) + 1
    first, second, third = corner.T
    starts = np.concatenate([first, second])
    ends = np.concatenate([second, third])
    edges = coo_array((np.ones(len(starts), bool), (starts, ends)), (corner_count, corner_count))
    _, component = connected_components(edges, directed=False)
    return np.asarray(component[first], np.int64)


def _height_m(faces: Triangles, name: str) -> float:
    """The height of all things of one name."""
    is_member = np.array([thing.name == name for thing in faces.things])[faces.thing]
    return float(np.ptp(faces.corners_m[is_member, :, 2]))
