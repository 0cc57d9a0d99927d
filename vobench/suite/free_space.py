"""Finds the free space on the floor of a scene by ray casting: the largest free circle, and a path in it."""

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from vobench.errors import SuiteError
from vobench.geometry.se3 import Array
from vobench.motion.spline import Pose, PoseSpline
from vobench.rendering.geometry import RayCaster
from vobench.scene.mesh import Triangles, areas_m2
from vobench.scene.scene import Scene, triangles

Mask = NDArray[np.bool_]

# The floor consists of nearly level faces at the same height, up to FLOOR_STEP_M.
LEVEL = 0.99  # cosine of the steepest level face
FLOOR_STEP_M = 0.02
FLOOR_SHARE = 0.4  # the smallest area of the floor, relative to the largest level area at any height

# The map of the floor, and the height of a body.
CELL_M = 0.1
MOST_CELLS = 600  # the largest number of cells along one side
BODY_M = 0.6
WALL_HEIGHTS_M = (0.1, 0.35, 0.6)  # where horizontal rays look for walls
SIDES = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])  # (4, 3) unit directions

# The circular path of a body.
LEAST_RADIUS_M = 0.2  # the smallest radius of the free circle
MOST_RADIUS_M = 4.0  # the largest radius of the path
SHARE_OF_CIRCLE = 0.6  # the radius of the path relative to that of the free circle
MOST_LENGTH_M = 10.0
CORNERS = 16
SPEED_MPS = 0.5
RATE_HZ = 10.0
EASE_S = 1.0

# Lamps below a ceiling.
SKY_RAYS = 512
LAMP_BELOW = 0.35  # the distance of a lamp from the ceiling, which it would overexpose, relative to the height
LAMP_SPACING = 2.5  # the distance between lamps, relative to the height of the ceiling
MOST_LAMPS = 4  # the largest number of lamps along one side


@dataclass(frozen=True, slots=True)
class FreeCircle:
    """The largest free circle on the floor: its centre (x, y), the floor's height and the radius, in metres."""

    x_m: float
    y_m: float
    floor_m: float
    radius_m: float


@dataclass(frozen=True, slots=True)
class _FloorMap:
    """A grid on the floor: cell centres x (W,) and y (H,), and which cells (H, W) are free."""

    x_m: Array
    y_m: Array
    free: Mask
    floor_m: float
    cell_m: float

    def largest_circle(self) -> FreeCircle | None:
        """The largest circle around the centre of a cell that contains free cells only."""
        # Cells beyond the map count as occupied.
        padded = np.pad(self.free, 1)
        distance_cells = scipy.ndimage.distance_transform_edt(padded)[1:-1, 1:-1]
        row, column = np.unravel_index(distance_cells.argmax(), distance_cells.shape)

        # Distances are between cell centres, but an occupied cell begins half a cell before its centre.
        radius_m = float((distance_cells[row, column] - 0.5) * self.cell_m)
        if radius_m <= 0:
            return None
        return FreeCircle(float(self.x_m[column]), float(self.y_m[row]), self.floor_m, radius_m)


def largest_free_circle(faces: Triangles, caster: RayCaster) -> FreeCircle | None:
    """The largest circle on the floor with nothing above it up to the height of a body; None if there is none.

    The floor is at the lowest height with a large level area, because roofs and upper storeys may be larger.
    """
    floor = _floor_map(faces, caster)
    return floor.largest_circle() if floor else None


def _floor_map(faces: Triangles, caster: RayCaster) -> _FloorMap | None:
    """The map of the floor; None if the scene has no level faces."""
    is_level = (faces.plane[:, 2] > LEVEL) & (faces.mover < 0)
    if not is_level.any():
        return None
    level_corners_m = faces.corners_m[is_level]  # (F, 3, 3)
    height_steps = np.rint(level_corners_m.mean(1)[:, 2] / FLOOR_STEP_M).astype(int)  # (F,)
    floor_m = _floor_height_m(level_corners_m, height_steps)

    # The grid covers the bounds of all faces at the floor's height.
    is_floor_face = np.abs(height_steps * FLOOR_STEP_M - floor_m) < FLOOR_STEP_M
    floor_corners_m = level_corners_m[is_floor_face].reshape(-1, 3)
    low_m = floor_corners_m.min(0)[:2]
    high_m = floor_corners_m.max(0)[:2]
    cell_m = max(CELL_M, float((high_m - low_m).max()) / MOST_CELLS)
    x_m = np.arange(low_m[0] + cell_m / 2, high_m[0], cell_m)
    y_m = np.arange(low_m[1] + cell_m / 2, high_m[1], cell_m)
    if not x_m.size or not y_m.size:
        return None

    # A cell is free if a ray down from the height of a body hits the floor first, and if no wall is near.
    centres_m = np.stack(np.meshgrid(x_m, y_m), -1).reshape(-1, 2)  # (H * W, 2)
    starts_m = _at_height(centres_m, floor_m + BODY_M)
    hits = caster.hits(starts_m, downward_directions(len(starts_m)))
    meets_floor = np.abs(hits.distance - BODY_M) < FLOOR_STEP_M
    is_free = meets_floor & (faces.plane[hits.face, 2] > 0)
    is_free[is_free] = _away_from_walls(centres_m[is_free], floor_m, cell_m, faces, caster)
    return _FloorMap(x_m, y_m, is_free.reshape(len(y_m), len(x_m)), floor_m, cell_m)


def _floor_height_m(level_corners_m: Array, height_steps: NDArray[np.int_]) -> float:
    """The lowest height at which level faces (F, 3, 3) have a large enough area.

    `height_steps` (F,) are the heights of the faces in units of FLOOR_STEP_M.
    """
    lowest_step = height_steps.min()
    area_by_step_m2 = np.bincount(height_steps - lowest_step, areas_m2(level_corners_m))
    large_steps = np.flatnonzero(area_by_step_m2 > FLOOR_SHARE * area_by_step_m2.max())
    return float((large_steps[0] + lowest_step) * FLOOR_STEP_M)


def _at_height(places_m: Array, z_m: float) -> Array:
    """The points (N, 3) at one height above places (N, 2)."""
    return np.column_stack([places_m, np.full(len(places_m), z_m)])


def _away_from_walls(centres_m: Array, floor_m: float, cell_m: float, faces: Triangles, caster: RayCaster) -> Mask:
    """Whether each cell (N, 2) has no wall within the width of a cell, and is not inside of a thing.

    A point is inside of a thing if rays to all four sides hit the backs of faces.
    """
    is_clear = np.ones(len(centres_m), bool)
    for height_m in WALL_HEIGHTS_M:
        starts_m = _at_height(centres_m, floor_m + height_m)
        is_inside = np.ones(len(centres_m), bool)
        for direction in SIDES:
            hits = caster.hits(starts_m, np.tile(direction, (len(starts_m), 1)))
            is_hit = hits.face >= 0
            is_clear &= ~is_hit | (hits.distance > cell_m)
            is_inside &= is_hit & (faces.plane[hits.face, :3] @ direction > 0)
        is_clear &= ~is_inside
    return is_clear


def downward_directions(count: int) -> Array:
    """Directions (N, 3) straight down."""
    return np.tile([0.0, 0.0, -1.0], (count, 1))


def circular_path(scene: Scene) -> PoseSpline:
    """A circular path around the centre of the largest free circle of a scene. The body looks ahead.

    Raises SuiteError if the free circle is too small, or if there is no floor.
    """
    faces = triangles(scene, t_ns=0)
    free = largest_free_circle(faces, RayCaster(faces))
    if free is None:
        raise _no_path(scene, "it has no level floor; is another axis up?")
    if free.radius_m < LEAST_RADIUS_M:
        raise _no_path(scene, f"the largest free circle on its floor has a radius of {free.radius_m:.2f} m")

    radius_m = min(SHARE_OF_CIRCLE * free.radius_m, MOST_RADIUS_M)
    share_of_turn = min(1.0, MOST_LENGTH_M / (2 * np.pi * radius_m))
    angles_rad = np.linspace(0, 2 * np.pi * share_of_turn, CORNERS)
    poses = tuple(_pose_on_circle(free, radius_m, angle_rad) for angle_rad in angles_rad)
    return PoseSpline(poses=poses, ease_s=EASE_S, rate_hz=RATE_HZ)


def _no_path(scene: Scene, reason: str) -> SuiteError:
    return SuiteError(f"no free path was found in '{scene.name}' ({reason}); add trajectories to the suite")


def _pose_on_circle(free: FreeCircle, radius_m: float, angle_rad: float) -> Pose:
    """The pose at an angle of a circle around the centre of the free circle, along the tangent."""
    x_m = free.x_m + radius_m * float(np.cos(angle_rad))
    y_m = free.y_m + radius_m * float(np.sin(angle_rad))
    return Pose(
        t_s=float(angle_rad * radius_m / SPEED_MPS),
        position_m=(x_m, y_m, free.floor_m),
        yaw_deg=float(np.rad2deg(angle_rad)) + 90,
    )


def ceiling_above(scene: Scene) -> tuple[float, list[tuple[float, float, float]]]:
    """The share of the sky that is visible from the floor, and the positions of lamps below the ceiling.

    There is one lamp above the free circle, or a grid of lamps in a hall that is much wider than high. In a scene
    without a floor, the whole sky is visible.
    """
    faces = triangles(scene, t_ns=0)
    caster = RayCaster(faces)
    floor = _floor_map(faces, caster)
    free = floor.largest_circle() if floor else None
    if floor is None or free is None:
        return 1.0, [(0.0, 0.0, 0.0)]

    eye_m = np.array([free.x_m, free.y_m, free.floor_m + BODY_M])
    hit_faces = caster.nearest(np.tile(eye_m, (SKY_RAYS, 1)), _upward_directions())
    sky_share = float((hit_faces < 0).mean())

    overhead = caster.hits(eye_m[None], -downward_directions(1))
    height_m = float(overhead.distance[0]) if overhead.face[0] >= 0 else BODY_M
    places_m = _grid_places(floor, LAMP_SPACING * (BODY_M + height_m))
    starts_m = _at_height(places_m, eye_m[2]) if len(places_m) > 1 else eye_m[None]

    # A place without a ceiling gets the height of the ceiling above the circle.
    ceiling = caster.hits(starts_m, -downward_directions(len(starts_m)))
    clearance_m = np.where(ceiling.face < 0, height_m, ceiling.distance)
    lamps_m = starts_m - (1 - LAMP_BELOW) * clearance_m[:, None] * downward_directions(1)
    return sky_share, [(x, y, z) for x, y, z in lamps_m.tolist()]


def _upward_directions() -> Array:
    """Random directions (SKY_RAYS, 3) in the upper hemisphere, which are the same in every run."""
    directions = np.abs(np.random.default_rng(0).standard_normal((SKY_RAYS, 3)))
    signs = np.sign(np.random.default_rng(1).standard_normal((SKY_RAYS, 2)))
    directions[:, :2] *= signs
    return directions


def _grid_places(floor: _FloorMap, spacing_m: float) -> Array:
    """Free places (N, 2) on an approximately regular grid: the most central free cell of each part of the floor."""
    cells = np.argwhere(floor.free)[:, ::-1]  # (N, 2) column and row
    size_cells = np.array(floor.free.shape[::-1])
    part_count = np.clip(np.rint(size_cells * floor.cell_m / spacing_m), 1, MOST_LAMPS)  # along x and y

    position = cells / size_cells * part_count  # in parts
    part = np.floor(position)
    off_centre = np.abs(position - part - 0.5).max(1)
    order = np.lexsort((off_centre, part[:, 1], part[:, 0]))
    first_of_each_part = np.unique(part[order], axis=0, return_index=True)[1]
    chosen = order[first_of_each_part]
    return np.column_stack([floor.x_m[cells[chosen, 0]], floor.y_m[cells[chosen, 1]]])
