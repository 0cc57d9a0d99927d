"""Where a body can drive in a scene, found by rays: its largest free circle, and a way round in it."""

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

# cosine of what counts as level, and how even a floor is
LEVEL = 0.99
FLOOR_STEP_M = 0.02
FLOOR_SHARE = 0.4  # of the largest level area, which a floor has at least
# of the map of free places, and the height of a body
CELL_M = 0.1
MOST_CELLS = 600
BODY_M = 0.6
# looked for walls
HEIGHTS_M = (0.1, 0.35, 0.6)
SIDES = np.array([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0]])
LEAST_RADIUS_M = 0.2
MOST_RADIUS_M = 4.0
OF_CIRCLE = 0.6
SPEED_MPS = 0.5
RATE_HZ = 10.0
EASE_S = 1.0
CORNERS = 16
MOST_LENGTH_M = 10.0


@dataclass(frozen=True, slots=True)
class Free:
    """The largest free circle on the floor: its middle (x, y), the floor's height and the radius, in metres."""

    x_m: float
    y_m: float
    floor_m: float
    radius_m: float


@dataclass(frozen=True, slots=True)
class _Floor:
    """Cells of a floor: their middles x (W,), y (H,), whether nothing stands there (H, W), and the floor's height."""

    x_m: Array
    y_m: Array
    free: NDArray[np.bool_]
    floor_m: float
    cell_m: float

    def largest(self) -> Free | None:
        distance = scipy.ndimage.distance_transform_edt(np.pad(self.free, 1))[1:-1, 1:-1]
        row, column = np.unravel_index(distance.argmax(), distance.shape)
        radius_m = float((distance[row, column] - 0.5) * self.cell_m)
        return Free(float(self.x_m[column]), float(self.y_m[row]), self.floor_m, radius_m) if radius_m > 0 else None


def free_circle(faces: Triangles, caster: RayCaster) -> Free | None:
    """The largest circle on the floor over which nothing stands lower than a body is high.

    The floor is the lowest height at which much level area lies: roofs and storeys above may have more.
    """
    floor = _floor(faces, caster)
    return floor.largest() if floor else None


def _floor(faces: Triangles, caster: RayCaster) -> _Floor | None:
    level = (faces.plane[:, 2] > LEVEL) & (faces.mover < 0)
    if not level.any():
        return None
    heights = np.rint(faces.corners_m[level].mean(1)[:, 2] / FLOOR_STEP_M).astype(int)
    areas = np.bincount(heights - heights.min(), areas_m2(faces.corners_m[level]))
    floor_m = float((np.flatnonzero(areas > FLOOR_SHARE * areas.max())[0] + heights.min()) * FLOOR_STEP_M)
    on_floor = faces.corners_m[level][np.abs(heights * FLOOR_STEP_M - floor_m) < FLOOR_STEP_M].reshape(-1, 3)
    low = on_floor.min(0)[:2]
    high = on_floor.max(0)[:2]
    cell_m = max(CELL_M, float((high - low).max()) / MOST_CELLS)
    x, y = (np.arange(a + cell_m / 2, b, cell_m) for a, b in zip(low, high, strict=True))
    if not x.size or not y.size:
        return None
    starts = np.stack(np.meshgrid(x, y), -1).reshape(-1, 2)
    hits = caster.hits(np.column_stack([starts, np.full(len(starts), floor_m + BODY_M)]), down(len(starts)))
    is_floor = (np.abs(hits.distance - BODY_M) < FLOOR_STEP_M) & (faces.plane[hits.face, 2] > 0)
    is_floor[is_floor] = _clear(starts[is_floor], floor_m, cell_m, faces, caster)
    return _Floor(x, y, is_floor.reshape(len(y), len(x)), floor_m, cell_m)


def _clear(at_m: Array, floor_m: float, cell_m: float, faces: Triangles, caster: RayCaster) -> Array:
    """Whether no wall stands in a cell (N, 2), nor around it: whoever sees backs on all sides is inside a thing."""
    clear = np.ones(len(at_m), bool)
    for height_m in HEIGHTS_M:
        starts = np.column_stack([at_m, np.full(len(at_m), floor_m + height_m)])
        backs = np.ones(len(at_m), bool)
        for way in SIDES:
            hits = caster.hits(starts, np.tile(way, (len(starts), 1)))
            clear &= (hits.face < 0) | (hits.distance > cell_m)
            backs &= (hits.face >= 0) & (faces.plane[hits.face, :3] @ way > 0)
        clear &= ~backs
    return clear


def down(count: int) -> Array:
    """Rays (N, 3) straight down."""
    return np.tile([0.0, 0.0, -1.0], (count, 1))


def free_way(scene: Scene) -> PoseSpline:
    """A way round in the scene's largest free circle, for a body that looks ahead. Raises SuiteError for none."""
    faces = triangles(scene, t_ns=0)
    free = free_circle(faces, RayCaster(faces))
    if free is None or free.radius_m < LEAST_RADIUS_M:
        found = "it has no level floor; is another axis up?"
        found = f"the largest free circle on its floor has {free.radius_m:.2f} m" if free else found
        raise SuiteError(f"no way for a body was found in '{scene.name}' ({found}); give trajectories")
    radius_m = min(OF_CIRCLE * free.radius_m, MOST_RADIUS_M)
    whole = 2 * np.pi * min(1.0, MOST_LENGTH_M / (2 * np.pi * radius_m))
    turned = np.linspace(0, whole, CORNERS)
    poses = [
        Pose(
            t_s=float(angle * radius_m / SPEED_MPS),
            position_m=(
                free.x_m + radius_m * float(np.cos(angle)), free.y_m + radius_m * float(np.sin(angle)), free.floor_m
            ),
            yaw_deg=float(np.rad2deg(angle)) + 90,
        )
        for angle in turned
    ]  # fmt: skip
    return PoseSpline(poses=tuple(poses), ease_s=EASE_S, rate_hz=RATE_HZ)


# ways up that are looked; how far down a lamp hangs, or its spot above drowns all
LOOKS = 512
LAMP_BELOW = 0.35
# in heights of the ceiling, and along a side
LAMPS_APART = 2.5
MOST_LAMPS = 4


def ceiling_above(scene: Scene) -> tuple[float, list[tuple[float, float, float]]]:
    """The share of the sky that a body sees where it is free, all without a floor; and where lamps would hang.

    That is above the free circle, or all over the floor of a hall that is much wider than high.
    """
    faces = triangles(scene, t_ns=0)
    caster = RayCaster(faces)
    floor = _floor(faces, caster)
    free = floor.largest() if floor else None
    if floor is None or free is None:
        return 1.0, [(0.0, 0.0, 0.0)]
    at = np.array([free.x_m, free.y_m, free.floor_m + BODY_M])
    ways = np.abs(np.random.default_rng(0).standard_normal((LOOKS, 3)))
    ways[:, :2] *= np.sign(np.random.default_rng(1).standard_normal((LOOKS, 2)))
    seen = caster.nearest(np.tile(at, (LOOKS, 1)), ways)
    above = caster.hits(at[None], np.array([[0.0, 0.0, 1.0]]))
    height_m = float(above.distance[0]) if above.face[0] >= 0 else BODY_M
    places = _apart(floor, LAMPS_APART * (BODY_M + height_m))
    starts = np.column_stack([places, np.full(len(places), at[2])]) if len(places) > 1 else at[None]
    ceiling = caster.hits(starts, -down(len(starts)))
    ends = starts - (1 - LAMP_BELOW) * np.where(ceiling.face < 0, height_m, ceiling.distance)[:, None] * down(1)
    return float((seen < 0).mean()), [(x, y, z) for x, y, z in ends.tolist()]


def _apart(floor: _Floor, step_m: float) -> Array:
    """The free cells (N, 2) next to the middles of parts of a floor some step wide, one in each where there is any."""
    cells = np.argwhere(floor.free)[:, ::-1]
    size = np.array(floor.free.shape[::-1])
    parts = np.clip(np.rint(size * floor.cell_m / step_m), 1, MOST_LAMPS)
    part = np.floor(cells / size * parts)
    apart = np.abs(cells / size * parts - part - 0.5).max(1)
    order = np.lexsort((apart, part[:, 1], part[:, 0]))
    first = order[np.unique(part[order], axis=0, return_index=True)[1]]
    return np.column_stack([floor.x_m[cells[first, 0]], floor.y_m[cells[first, 1]]])
