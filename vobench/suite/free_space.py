"""Finds the free space on the floor or the ground of a scene by ray casting: the largest free circle, and a path in it.

Most places have a level floor. Outdoors the ground may be uneven: then its height is found in every cell of the map.
"""

from dataclasses import dataclass

import numpy as np
import scipy

from vobench.errors import SuiteError
from vobench.geometry.se3 import Array
from vobench.motion.spline import Pose, PoseSpline
from vobench.motion.wander import Clearance
from vobench.rendering.array_types import Mask
from vobench.rendering.geometry import RayCaster
from vobench.scene.scene import Scene, triangles
from vobench.scene.triangles import Triangles
from vobench.suite.level_floor import FLOOR_STEP_M, level_floor
from vobench.suite.uneven_ground import ground_heights_m, is_under_sheet, uneven_ground

# The map of the floor, and the height of a body.
CELL_M = 0.1
MOST_CELLS = 600  # the largest number of cells along one side
BODY_M = 0.6
GROUND_STEP_M = 0.06  # from uneven ground up to what lies on it and is no obstacle, such as a path
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

    `floor_m` is the height of a level floor, or the median height of uneven ground.
    `ground_m` is the height (H, W) of uneven ground; None for a level floor.
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
        """The largest circle around the centre of a cell that contains free cells only; None if no cell is free."""
        distances_m = self._distances_m()
        row, column = np.unravel_index(distances_m.argmax(), distances_m.shape)
        radius_m = float(distances_m[row, column])
        if radius_m <= 0:
            return None
        x_m = float(self.x_m[column])
        y_m = float(self.y_m[row])
        return FreeCircle(x_m, y_m, self._highest_floor_m(x_m, y_m, radius_m), radius_m)

    def _highest_floor_m(self, x_m: float, y_m: float, radius_m: float) -> float:
        """The highest floor in a free circle, so that nothing on a level path is below the ground."""
        if self.ground_m is None:
            return self.floor_m
        distance_m = np.hypot(self.x_m - x_m, self.y_m[:, None] - y_m)  # (H, W)
        is_in_reach = distance_m <= min(radius_m, MOST_RADIUS_M)
        return float(self.ground_m[is_in_reach].max())


@dataclass(frozen=True, slots=True)
class _Grid:
    """The cells of a map: the x (W,) and the y (H,) of their centres, and the side of a cell."""

    x_m: Array
    y_m: Array
    cell_m: float

    @property
    def shape(self) -> tuple[int, int]:
        """The numbers of rows and columns (H, W)."""
        return len(self.y_m), len(self.x_m)

    @property
    def centres_m(self) -> Array:
        """The centres (H * W, 2) of the cells, row by row."""
        return np.stack(np.meshgrid(self.x_m, self.y_m), -1).reshape(-1, 2)


def largest_free_circle(faces: Triangles, caster: RayCaster) -> FreeCircle | None:
    """The largest circle on the floor with nothing above it up to the height of a body; None if there is none."""
    floor = floor_map(faces, caster)
    return floor.largest_circle() if floor else None


def floor_map(faces: Triangles, caster: RayCaster, *, body_m: float = BODY_M) -> FloorMap | None:
    """The map of the floor or ground for a body of some height; None if the scene has neither."""
    is_ground = uneven_ground(faces)
    if is_ground.any():
        grid = _grid_over(faces.corners_m[is_ground])
        heights_m = ground_heights_m(faces, is_ground, grid.centres_m)
        if np.isnan(heights_m).all():
            return None
        return _map_of_uneven_ground(grid, heights_m, faces, caster, body_m=body_m)

    floor = level_floor(faces)
    if floor is None:
        return None
    grid = _grid_over(floor.corners_m)
    if 0 in grid.shape:
        return None
    return _map_of_level_floor(grid, floor.height_m, faces, caster, body_m=body_m)


def _grid_over(corners_m: Array) -> _Grid:
    """The grid over the bounds of faces (F, 3, 3). It has no cells if they are narrower than half a cell."""
    points_m = corners_m.reshape(-1, 3)[:, :2]
    low_m = points_m.min(0)
    high_m = points_m.max(0)
    longer_side_m = float((high_m - low_m).max())
    cell_m = max(CELL_M, longer_side_m / MOST_CELLS)
    x_m = np.arange(low_m[0] + cell_m / 2, high_m[0], cell_m)
    y_m = np.arange(low_m[1] + cell_m / 2, high_m[1], cell_m)
    return _Grid(x_m, y_m, cell_m)


def _map_of_level_floor(
    grid: _Grid,
    floor_m: float,
    faces: Triangles,
    caster: RayCaster,
    *,
    body_m: float,
) -> FloorMap:
    """The map of a floor at one height."""
    centres_m = grid.centres_m
    is_free = _is_free(
        centres_m,
        np.full(len(centres_m), floor_m),
        faces,
        caster,
        cell_m=grid.cell_m,
        body_m=body_m,
        step_m=FLOOR_STEP_M,
        needs_upward_face=True,
    )
    return FloorMap(grid.x_m, grid.y_m, is_free.reshape(grid.shape), floor_m, grid.cell_m)


def _map_of_uneven_ground(
    grid: _Grid,
    heights_m: Array,
    faces: Triangles,
    caster: RayCaster,
    *,
    body_m: float,
) -> FloorMap:
    """The map of ground with a height (H * W,) in each cell, NaN where there is none."""
    has_ground = ~np.isnan(heights_m)
    # What is less than a step below a sheet, such as the ground under a path, is no obstacle.
    above_step_m = np.column_stack([grid.centres_m, heights_m + GROUND_STEP_M])
    is_dry = has_ground.copy()
    is_dry[has_ground] = ~is_under_sheet(faces, above_step_m[has_ground])
    is_free = np.zeros(len(heights_m), bool)
    is_free[is_dry] = _is_free(
        grid.centres_m[is_dry],
        heights_m[is_dry],
        faces,
        caster,
        cell_m=grid.cell_m,
        body_m=body_m,
        step_m=GROUND_STEP_M,
        needs_upward_face=False,
    )
    # Cells without ground get the height of the nearest one that has some, so that heights can be interpolated.
    nearest = scipy.ndimage.distance_transform_edt(
        ~has_ground.reshape(grid.shape), return_distances=False, return_indices=True
    )
    ground_m = heights_m.reshape(grid.shape)[tuple(nearest)]
    median_m = float(np.median(heights_m[has_ground]))
    return FloorMap(grid.x_m, grid.y_m, is_free.reshape(grid.shape), median_m, grid.cell_m, ground_m)


def _is_free(
    centres_m: Array,
    floors_m: Array,
    faces: Triangles,
    caster: RayCaster,
    *,
    cell_m: float,
    body_m: float,
    step_m: float,
    needs_upward_face: bool,
) -> Mask:
    """Whether a body fits into each cell (N, 2): nothing is above the floor (N,), and no wall is near.

    A ray down from the height of a body has to meet the floor, or something that is at most `step_m` away from it.
    `needs_upward_face` excludes the backs of faces, such as the inside of the bottom of a box.
    """
    starts_m = np.column_stack([centres_m, floors_m + body_m])
    hits = caster.hits(starts_m, downward_directions(len(starts_m)))
    is_free: Mask = np.abs(hits.distance - body_m) < step_m
    if needs_upward_face:
        is_free = is_free & (faces.plane[hits.face, 2] > 0)
    is_free[is_free] = _is_away_from_walls(
        centres_m[is_free], floors_m[is_free], faces, caster, cell_m=cell_m, body_m=body_m
    )
    return is_free


def _is_away_from_walls(
    centres_m: Array,
    floors_m: Array,
    faces: Triangles,
    caster: RayCaster,
    *,
    cell_m: float,
    body_m: float,
) -> Mask:
    """Whether each cell (N, 2) has no wall within the width of a cell, and is not inside of a thing.

    `floors_m` (N,) are the heights of the floor there. A point is inside of a thing if rays to all four sides hit the
    backs of faces.
    """
    is_clear = np.ones(len(centres_m), bool)
    heights_m = [height_m for height_m in WALL_HEIGHTS_M if height_m <= body_m]
    for height_m in heights_m:
        starts_m = np.column_stack([centres_m, floors_m + height_m])
        is_inside = np.ones(len(centres_m), bool)
        for direction in SIDES:
            hits = caster.hits(starts_m, np.tile(direction, (len(starts_m), 1)))
            is_hit = hits.face >= 0
            is_near = is_hit & (hits.distance <= cell_m)
            is_back = is_hit & (faces.plane[hits.face, :3] @ direction > 0)
            is_clear &= ~is_near
            is_inside &= is_back
        is_clear &= ~is_inside
    return is_clear


def at_height(places_m: Array, z_m: float) -> Array:
    """Points (N, 3) at one height above places (N, 2)."""
    return np.column_stack([places_m, np.full(len(places_m), z_m)])


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
