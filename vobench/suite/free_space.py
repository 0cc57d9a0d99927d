"""Finds the free space on the floor or the ground of a scene by ray casting: the largest free circle, and a path in it.

Most places have a level floor. Outdoors the ground may be uneven: then its height is found in every cell of the map.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from vobench.errors import SuiteError
from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2
from vobench.motion.spline import Pose, PoseSpline
from vobench.motion.wander import Clearance
from vobench.rendering.geometry import RayCaster
from vobench.scene.scene import Scene, triangles
from vobench.scene.triangles import Triangles

Mask = NDArray[np.bool_]

# The floor consists of nearly level faces at the same height, up to FLOOR_STEP_M.
LEVEL = 0.99  # cosine of the steepest level face
FLOOR_STEP_M = 0.02
FLOOR_SHARE = 0.4  # the smallest area of the floor, relative to the largest level area at any height

# The ground is uneven if so small a share of the largest thing that faces up is at any one height.
UNEVEN_SHARE = 0.2
GENTLE = 0.97  # cosine of the steepest ground on which a body moves, 14 degrees
GROUND_STEP_M = 0.06  # from the ground up to what lies on it and is no obstacle, such as a path
GROUND_AREA_SHARE = 0.05  # of the largest uneven thing, which another one has to have to belong to the ground
GROUND_EXTENT_SHARE = 0.3  # of its extent in plan, likewise: a tree may have many level leaves

# The map of the floor, and the height of a body.
CELL_M = 0.1
MOST_CELLS = 600  # the largest number of cells along one side
BODY_M = 0.6
WALL_HEIGHTS_M = (0.1, 0.35, 0.6, 0.9, 1.2, 1.5, 1.8)  # where horizontal rays look for walls, up to a body's height
SIDES = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])  # (4, 3) unit directions

# The circular path of a body.
LEAST_RADIUS_M = 0.2  # of the free circle
LEAST_PLACE_M = 2.0  # the longer side of what a body drives in; what is smaller is an object
MOST_RADIUS_M = 4.0  # of the path
SHARE_OF_CIRCLE = 0.6  # radius of the path relative to the free circle's
MOST_LENGTH_M = 10.0
CORNERS = 16
SPEED_MPS = 0.5
RATE_HZ = 10.0
EASE_S = 1.0


@dataclass(frozen=True, slots=True)
class FreeCircle:
    """The largest free circle on the floor: its centre (x, y), the floor's height and the radius, in metres."""

    x_m: float
    y_m: float
    floor_m: float
    radius_m: float


@dataclass(frozen=True, slots=True)
class FloorMap:
    """A grid on the floor: cell centres x (W,) and y (H,), and which cells (H, W) are free.

    ground_m: the height (H, W) of uneven ground; None for a level floor, which is at floor_m.
    """

    x_m: Array
    y_m: Array
    free: Mask
    floor_m: float
    cell_m: float
    ground_m: Array | None = None

    def clearance(self) -> Clearance:
        """The distance from every cell to the nearest one that is not free."""
        return Clearance(
            x_m=float(self.x_m[0]),
            y_m=float(self.y_m[0]),
            floor_m=self.floor_m,
            cell_m=self.cell_m,
            distance_m=self._distances_m(),
            ground_m=self.ground_m,
        )

    def _distances_m(self) -> Array:
        """Distances (H, W) from the centres of free cells to the border of the nearest cell that is not free."""
        # Cells beyond the map count as occupied.
        padded = np.pad(self.free, 1)
        distance_cells = scipy.ndimage.distance_transform_edt(padded)[1:-1, 1:-1]
        # Distances are between cell centres, but an occupied cell begins half a cell before its centre.
        distances_m: Array = np.maximum(distance_cells - 0.5, 0.0) * self.cell_m
        return distances_m

    def largest_circle(self) -> FreeCircle | None:
        """The largest circle around the centre of a cell that contains free cells only.

        On uneven ground, its floor is the highest ground in it, so that nothing on a level path is below the ground.
        """
        distances_m = self._distances_m()
        row, column = np.unravel_index(distances_m.argmax(), distances_m.shape)
        radius_m = float(distances_m[row, column])
        if radius_m <= 0:
            return None
        x_m = float(self.x_m[column])
        y_m = float(self.y_m[row])
        floor_m = self.floor_m
        if self.ground_m is not None:
            distance_m = np.hypot(self.x_m - x_m, self.y_m[:, None] - y_m)
            floor_m = float(self.ground_m[distance_m <= min(radius_m, MOST_RADIUS_M)].max())
        return FreeCircle(x_m, y_m, floor_m, radius_m)


def largest_free_circle(faces: Triangles, caster: RayCaster) -> FreeCircle | None:
    """The largest circle on the floor with nothing above it up to the height of a body; None if there is none.

    The floor is at the lowest height with a large level area, because roofs and upper storeys may be larger.
    """
    floor = floor_map(faces, caster)
    return floor.largest_circle() if floor else None


def floor_map(faces: Triangles, caster: RayCaster, *, body_m: float = BODY_M) -> FloorMap | None:
    """The map of the floor or ground for a body of some height; None if the scene has neither."""
    is_ground = _uneven_ground(faces)
    if is_ground.any():
        return _ground_map(faces, caster, is_ground, body_m=body_m)
    is_level = _is_level(faces)
    if not is_level.any():
        return None
    level_corners_m = faces.corners_m[is_level]  # (F, 3, 3)
    height_steps = _height_steps(level_corners_m)
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
    starts_m = at_height(centres_m, floor_m + body_m)
    hits = caster.hits(starts_m, downward_directions(len(starts_m)))
    meets_floor = np.abs(hits.distance - body_m) < FLOOR_STEP_M
    is_free = meets_floor & (faces.plane[hits.face, 2] > 0)
    heights_m = [height_m for height_m in WALL_HEIGHTS_M if height_m <= body_m]
    floors_m = np.full(int(is_free.sum()), floor_m)
    is_free[is_free] = _away_from_walls(centres_m[is_free], floors_m, cell_m, faces, caster, heights_m=heights_m)
    return FloorMap(x_m, y_m, is_free.reshape(len(y_m), len(x_m)), floor_m, cell_m)


def _uneven_ground(faces: Triangles) -> Mask:
    """Whether each face belongs to uneven ground; all False if the ground is level.

    The ground is the stationary thing with the largest area that faces up and is gentle, and others like it.
    """
    is_gentle = (faces.plane[:, 2] > GENTLE) & (faces.mover < 0) & (faces.thing >= 0)
    things = faces.thing[is_gentle]
    if not len(things):
        return is_gentle
    area_m2 = areas_m2(faces.corners_m[is_gentle])
    height_steps = _height_steps(faces.corners_m[is_gentle])

    area_of_thing_m2 = np.bincount(things, area_m2)
    largest = int(area_of_thing_m2.argmax())
    if not _is_uneven(height_steps[things == largest], area_m2[things == largest]):
        return np.zeros(len(faces.thing), bool)
    ground = []
    corners_m = faces.corners_m[is_gentle]
    least_extent_m = GROUND_EXTENT_SHARE * _extent_m(corners_m[things == largest])
    for thing in np.flatnonzero(area_of_thing_m2 > GROUND_AREA_SHARE * area_of_thing_m2[largest]).tolist():
        is_of_thing = things == thing
        is_wide = _extent_m(corners_m[is_of_thing]) > least_extent_m
        if is_wide and _is_uneven(height_steps[is_of_thing], area_m2[is_of_thing]):
            ground.append(thing)
    is_ground: Mask = is_gentle & np.isin(faces.thing, ground)
    return is_ground


def _extent_m(corners_m: Array) -> float:
    """The longer side of the box in plan around faces (F, 3, 3)."""
    points_m = corners_m.reshape(-1, 3)[:, :2]
    return float((points_m.max(0) - points_m.min(0)).max())


def _is_uneven(height_steps: NDArray[np.int_], area_m2: Array) -> bool:
    """Whether no height step has a large share of the area (F,) of faces."""
    by_height_m2 = np.bincount(height_steps - height_steps.min(), area_m2)
    return bool(by_height_m2.max() < UNEVEN_SHARE * by_height_m2.sum())


def _ground_map(faces: Triangles, caster: RayCaster, is_ground: Mask, *, body_m: float) -> FloorMap | None:
    """The map of uneven ground, which consists of some of the faces (F,)."""
    ground_corners_m = faces.corners_m[is_ground].reshape(-1, 3)
    low_m = ground_corners_m.min(0)[:2]
    high_m = ground_corners_m.max(0)[:2]
    cell_m = max(CELL_M, float((high_m - low_m).max()) / MOST_CELLS)
    x_m = np.arange(low_m[0] + cell_m / 2, high_m[0], cell_m)
    y_m = np.arange(low_m[1] + cell_m / 2, high_m[1], cell_m)
    centres_m = np.stack(np.meshgrid(x_m, y_m), -1).reshape(-1, 2)  # (H * W, 2)

    ground_caster = RayCaster(faces, np.flatnonzero(is_ground))
    top_m = float(ground_corners_m[:, 2].max()) + 1.0
    to_ground = ground_caster.hits(at_height(centres_m, top_m), downward_directions(len(centres_m)))
    has_ground = to_ground.face >= 0
    if not has_ground.any():
        return None
    heights_m = np.where(has_ground, top_m - to_ground.distance, 0.0)

    # A cell is free if a ray down from the height of a body meets the ground first, and if no wall is near.
    starts_m = np.column_stack([centres_m, heights_m + body_m])
    hits = caster.hits(starts_m, downward_directions(len(starts_m)))
    is_free = has_ground & (np.abs(hits.distance - body_m) < GROUND_STEP_M)
    wall_heights_m = [height_m for height_m in WALL_HEIGHTS_M if height_m <= body_m]
    is_free[is_free] = _away_from_walls(
        centres_m[is_free], heights_m[is_free], cell_m, faces, caster, heights_m=wall_heights_m
    )
    shape = (len(y_m), len(x_m))
    # Cells without ground get the height of the nearest one that has some, so that heights can be interpolated.
    nearest = scipy.ndimage.distance_transform_edt(
        ~has_ground.reshape(shape), return_distances=False, return_indices=True
    )
    ground_m = heights_m.reshape(shape)[tuple(nearest)]
    return FloorMap(x_m, y_m, is_free.reshape(shape), float(np.median(heights_m[has_ground])), cell_m, ground_m)


def floor_height_m(faces: Triangles) -> float | None:
    """The height of the floor of a scene; None if the scene has no level face."""
    level_corners_m = faces.corners_m[_is_level(faces)]  # (F, 3, 3)
    if not len(level_corners_m):
        return None
    return _floor_height_m(level_corners_m, _height_steps(level_corners_m))


def _is_level(faces: Triangles) -> Mask:
    """Whether each face is stationary, nearly level, and faces up."""
    is_level: Mask = (faces.plane[:, 2] > LEVEL) & (faces.mover < 0)
    return is_level


def _height_steps(level_corners_m: Array) -> NDArray[np.int_]:
    """The heights (F,) of level faces (F, 3, 3) in units of FLOOR_STEP_M."""
    heights_m = level_corners_m.mean(1)[:, 2]
    steps: NDArray[np.int_] = np.rint(heights_m / FLOOR_STEP_M).astype(int)
    return steps


def _floor_height_m(level_corners_m: Array, height_steps: NDArray[np.int_]) -> float:
    """The lowest height at which level faces (F, 3, 3) have a large enough area.

    `height_steps` (F,) are the heights of the faces in units of FLOOR_STEP_M.
    """
    lowest_step = height_steps.min()
    area_by_step_m2 = np.bincount(height_steps - lowest_step, areas_m2(level_corners_m))
    large_steps = np.flatnonzero(area_by_step_m2 > FLOOR_SHARE * area_by_step_m2.max())
    return float((large_steps[0] + lowest_step) * FLOOR_STEP_M)


def at_height(places_m: Array, z_m: float) -> Array:
    """Points (N, 3) at one height above places (N, 2)."""
    return np.column_stack([places_m, np.full(len(places_m), z_m)])


def _away_from_walls(
    centres_m: Array,
    floors_m: Array,
    cell_m: float,
    faces: Triangles,
    caster: RayCaster,
    *,
    heights_m: Sequence[float],
) -> Mask:
    """Whether each cell (N, 2) has no wall within the width of a cell at some heights, and is not inside of a thing.

    floors_m (N,) are the heights of the floor there. A point is inside of a thing if rays to all four sides hit the
    backs of faces.
    """
    is_clear = np.ones(len(centres_m), bool)
    for height_m in heights_m:
        starts_m = np.column_stack([centres_m, floors_m + height_m])
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

    Raises SuiteError if the free circle or the scene is too small, or there is no floor.
    """
    faces = triangles(scene, t_ns=0)
    longer_side_m = longer_level_side_m(faces)
    if longer_side_m < LEAST_PLACE_M:
        raise _no_path(scene, f"it is only {longer_side_m:.2g} m wide")
    free = largest_free_circle(faces, RayCaster(faces))
    if free is None:
        raise _no_path(scene, "it has no level floor; is another axis up?")
    if free.radius_m < LEAST_RADIUS_M:
        raise _no_path(scene, f"the largest free circle on its floor has a radius of {free.radius_m:.2f} m")

    radius_m = path_radius_m(free)
    share_of_turn = min(1.0, MOST_LENGTH_M / (2 * np.pi * radius_m))
    angles_rad = np.linspace(0, 2 * np.pi * share_of_turn, CORNERS)
    poses = tuple(_pose_on_circle(free, radius_m, angle_rad) for angle_rad in angles_rad)
    return PoseSpline(poses=poses, ease_s=EASE_S, rate_hz=RATE_HZ)


def longer_level_side_m(faces: Triangles) -> float:
    """The length of the longer level side of the box around a scene."""
    low_m = faces.corners_m.min((0, 1))
    high_m = faces.corners_m.max((0, 1))
    return float((high_m - low_m)[:2].max())


def path_radius_m(free: FreeCircle) -> float:
    """The radius of the path in a free circle."""
    return min(SHARE_OF_CIRCLE * free.radius_m, MOST_RADIUS_M)


def _no_path(scene: Scene, reason: str) -> SuiteError:
    return SuiteError(
        f"no free path was found in '{scene.name}' ({reason}); add trajectories to the suite, or if it is an object, "
        "put it into a scene's YAML as one of its meshes"
    )


def _pose_on_circle(free: FreeCircle, radius_m: float, angle_rad: float) -> Pose:
    """The pose at an angle of a circle around the centre of the free circle, along the tangent."""
    x_m = free.x_m + radius_m * float(np.cos(angle_rad))
    y_m = free.y_m + radius_m * float(np.sin(angle_rad))
    return Pose(
        t_s=float(angle_rad * radius_m / SPEED_MPS),
        position_m=(x_m, y_m, free.floor_m),
        yaw_deg=float(np.rad2deg(angle_rad)) + 90,
    )
