"""Places the path of a recording into a scene so that the distances of the visible surfaces agree."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import Any

import numpy as np
import scipy

from vobench.analysis.stereo_fit import StereoFit
from vobench.errors import InputError
from vobench.estimator.stereo import StereoPair
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.rendering.geometry import RayCaster
from vobench.scene.scene import Scene, triangles

# --- Disparities of a recording ---

CELLS = 3  # rows and columns of the left view in which disparities are compared
MIN_MATCHES_IN_CELL = 30
MIN_DISPARITY_PX = 0.3  # points that are further away count as infinitely far


def cell_disparities(fit: StereoFit, pair: StereoPair) -> Array:
    """The median disparity (V, 3, 3) in px of a recording's matches, by rows and columns of the left view.

    V is the number of segments of the path in which matches were found. NaN for a cell with too few matches.
    """
    matches = fit.matches
    offset_px = 0.0
    if fit.offset_px and fit.offset_px.is_plain:
        offset_px = fit.offset_px.value
    camera = pair.left.camera

    # Matches have normalised coordinates in the right view. Rectified views show a point in the same row, and the left
    # view shows it further right by the disparity.
    homogeneous = np.c_[matches.place, np.ones(len(matches.place))]
    right_px = homogeneous @ pair.K.T
    left_column_px = right_px[:, 0] + matches.disparity_px
    column = _cell(left_column_px, camera.width_px)
    row = _cell(right_px[:, 1], camera.height_px)

    segment_of_match = matches.window
    segments = int(segment_of_match.max()) + 1
    medians_px = np.full((segments, CELLS, CELLS), np.nan)
    for segment, cell_row, cell_column in np.ndindex(medians_px.shape):
        is_in_cell = (segment_of_match == segment) & (row == cell_row) & (column == cell_column)
        if is_in_cell.sum() >= MIN_MATCHES_IN_CELL:
            median_px = np.median(matches.disparity_px[is_in_cell])
            medians_px[segment, cell_row, cell_column] = median_px - offset_px
    return np.asarray(np.maximum(medians_px, MIN_DISPARITY_PX), float)


def _cell(pixel: Array, size_px: int) -> Array:
    """The index of the cell (N,) of pixels (N,) along one axis."""
    number = (pixel * CELLS / size_px).astype(int)
    return np.asarray(np.clip(number, 0, CELLS - 1))


# --- The path ---


def levelled(T_world_left: Array) -> Array:
    """The path (N, 4, 4), whose world is the frame of the first camera, rotated to be as level as possible."""
    positions_m = T_world_left[:, :3, 3] - T_world_left[:, :3, 3].mean(0)
    horizontal_m = positions_m[:, :2]
    covariance = horizontal_m.T @ horizontal_m
    # A straight path does not determine the slope across it. The damping keeps that slope at 0.
    damping = 1e-3 * np.trace(covariance) * np.eye(2)
    damped = covariance + damping + 1e-9 * np.eye(2)
    slope = np.linalg.solve(damped, horizontal_m.T @ positions_m[:, 2])

    normal = np.array([*-slope, 1.0]) / np.sqrt(1 + slope @ slope)
    axis = np.cross(normal, [0.0, 0.0, 1.0])
    sine = float(np.linalg.norm(axis))
    angle_rad = np.arctan2(sine, normal[2])
    unit_axis = axis / max(sine, 1e-12)
    rotation = scipy.spatial.transform.Rotation.from_rotvec(unit_axis * angle_rad)
    level: Array = se3.transform(rotation.as_matrix(), np.zeros(3)) @ T_world_left
    return level


def _thinned(T: Array, count: int) -> Array:
    """At most `count` evenly spaced poses of a path (N, 4, 4)."""
    rows = np.unique(np.linspace(0, len(T) - 1, count).astype(int))
    return np.asarray(T[rows], float)


def _scaled_down(T: Array, scale: float) -> Array:
    """Poses (N, 4, 4) with their positions divided by a scale."""
    return se3.transform(T[:, :3, :3], T[:, :3, 3] / scale)


def _scaled_up(T: Array, scale: float) -> Array:
    """A pose (4, 4) with its position multiplied by a scale."""
    return se3.transform(T[:3, :3], T[:3, 3] * scale)


# --- The search for a placement ---


@dataclass(frozen=True, slots=True)
class Placement:
    """The pose of a path in a place, the scale of the place, and the mean error of log disparities.

    `scale` is the factor by which the place is enlarged. `tried` is the number of free paths that were compared.
    """

    T_place_world: Array
    scale: float
    misfit: float
    tried: int

    def as_dict(self) -> dict[str, Any]:
        """Plain JSON values."""
        facts = asdict(self)
        return {**facts, "T_place_world": self.T_place_world.tolist()}

    @classmethod
    def of_dict(cls, facts: Mapping[str, Any]) -> "Placement":
        """The placement that `as_dict` described."""
        T_place_world = np.array(facts["T_place_world"], float)
        return cls(**{**facts, "T_place_world": T_place_world})


# More unusual scales come later, and are drawn less often.
SCALES = (1.0, 0.7, 1.4, 0.5, 2.0, 0.35, 2.8, 4.0, 5.6)
MEAN_SCALE_INDEX = 2.5
HEIGHTS_M = (0.3, 0.5, 0.8, 1.2, 1.65, 2.2)
CLEARANCE_M = 0.3
WAYPOINTS = 40
EXTENT_QUANTILE = 0.01  # of the corners of faces: a few far ones do not extend the place

UP = np.array([[0.0, 0.0, 1.0]])
DOWN = -UP
LEVEL_COSINE = 0.9  # a face is level if the cosine of the angle between its normal and the vertical is larger
MAX_LAYERS = 4  # faces below a point that are examined
BEYOND_FACE_M = 1e-3
ABOVE_PLACE_M = 1.0

# The numbers of draws anywhere in the place, and then closer and closer to the best one.
DRAWS = 6000
NEAR_DRAWS = 1500
NEAR_M = 1.0
NEAR_RAD = 0.3  # of the heading, and of the logarithm of the height
LAST_SHARE = 0.05  # of these distances, at the last draw
SCALE_COST = 0.05  # misfit that is worth a factor e of the scale


@dataclass(frozen=True, slots=True)
class _Start:
    """A candidate for the start of a path: its height above the ground, heading, and position (2,).

    `scale` enlarges the scene. The height is in the enlarged scene, the position in the scene as it is.
    """

    scale: float
    height_m: float
    heading_rad: float
    xy_m: Array

    def near(self, share: float, rng: np.random.Generator) -> "_Start":
        """Draw a start near this one. `share` scales the usual distance."""
        height, heading, x, y = (share * rng.standard_normal(4)).tolist()
        return _Start(
            scale=self.scale,
            height_m=self.height_m * np.exp(NEAR_RAD * height),
            heading_rad=self.heading_rad + NEAR_RAD * heading,
            xy_m=self.xy_m + NEAR_M * np.array([x, y]),
        )


@dataclass(frozen=True, slots=True)
class _Best:
    """The best candidate so far."""

    cost: float
    start: _Start
    placement: Placement


def place_path(
    scene: Scene,
    T_world_left: Array,
    pair: StereoPair,
    wanted_px: Array,
    *,
    seed: int = 0,
) -> Placement:
    """Place a path (N, 4, 4) of the left camera into a scene so that disparities agree and the path is free.

    `wanted_px` (V, 3, 3) are the disparities in V segments of the path. Raises InputError if no free path is found.
    """
    surroundings = _Surroundings.of(scene)
    path = _thinned(T_world_left, WAYPOINTS)
    rng = np.random.default_rng(seed)
    best: _Best | None = None
    tried = 0
    for draw in range(DRAWS + NEAR_DRAWS):
        start = _draw_start(draw, surroundings, best, rng)
        T_scene_world = surroundings.free_pose(path, start)
        if T_scene_world is None:
            continue
        tried += 1

        path_in_scene = T_scene_world @ _scaled_down(path, start.scale)
        seen_px = segment_disparities(surroundings.caster, path_in_scene, pair, start.scale, len(wanted_px))
        misfit = float(np.nanmean(np.abs(np.log(seen_px / wanted_px))))
        cost = misfit + SCALE_COST * abs(np.log(start.scale))
        if best is None or cost < best.cost:
            T_place_world = _scaled_up(T_scene_world, start.scale)
            best = _Best(cost, start, Placement(T_place_world, start.scale, misfit, tried=0))

    if best is None:
        steps_m = np.diff(T_world_left[:, :3, 3], axis=0)
        length_m = float(np.linalg.norm(steps_m, axis=1).sum())
        raise InputError(
            f"no free path of {length_m:.1f} m was found in '{scene.name}'; take fewer images or another place"
        )
    return replace(best.placement, tried=tried)


def _draw_start(draw: int, surroundings: "_Surroundings", best: _Best | None, rng: np.random.Generator) -> _Start:
    """The candidate of a draw: first anywhere, then at a decreasing distance from the best one."""
    if draw < DRAWS or best is None:
        return surroundings.any_start(rng)
    progress = (draw - DRAWS) / NEAR_DRAWS
    return best.start.near(LAST_SHARE**progress, rng)


def _directions_around() -> Array:
    """Unit vectors (26, 3) to the neighbours of a cell."""
    neighbours = np.array(list(product((-1.0, 0.0, 1.0), repeat=3)))
    lengths = np.linalg.norm(neighbours, axis=1)
    is_other = lengths > 0
    directions: Array = neighbours[is_other] / lengths[is_other, None]
    return directions


DIRECTIONS_AROUND = _directions_around()


@dataclass(frozen=True, slots=True)
class _Surroundings:
    """The scene that a path is placed into: its ray caster, normals of faces (F, 3), and extent (3,)."""

    caster: RayCaster
    normals: Array
    low_m: Array
    high_m: Array

    @classmethod
    def of(cls, scene: Scene) -> "_Surroundings":
        faces = triangles(scene, t_ns=0)
        corners_m = faces.corners_m.reshape(-1, 3)
        low_m = np.quantile(corners_m, EXTENT_QUANTILE, axis=0)
        high_m = np.quantile(corners_m, 1 - EXTENT_QUANTILE, axis=0)
        return cls(RayCaster(faces), faces.plane, low_m, high_m)

    def any_start(self, rng: np.random.Generator) -> _Start:
        """Draw a start anywhere in the place."""
        scale_index = min(int(rng.exponential(MEAN_SCALE_INDEX)), len(SCALES) - 1)
        return _Start(
            scale=SCALES[scale_index],
            height_m=float(rng.choice(HEIGHTS_M)),
            heading_rad=float(rng.uniform(0, 2 * np.pi)),
            xy_m=rng.uniform(self.low_m[:2], self.high_m[:2]),
        )

    def free_pose(self, path: Array, start: _Start) -> Array | None:
        """The pose T_scene_world (4, 4) that moves a path, scaled down, to a start; None if it is not free there."""
        height_m = start.height_m / start.scale
        ground_m = self._ground_m(start.xy_m)
        if ground_m is None or not self._is_open_above(start.xy_m, ground_m, height_m):
            return None

        # The lowest pose of the path is at the height of the start; the first pose may be higher.
        first_position_m = path[0, :3, 3]
        lowest_offset_m = float((path[:, 2, 3] - first_position_m[2]).min())
        first_height_m = (start.height_m - min(lowest_offset_m, 0.0)) / start.scale

        rotation = se3.rotation_z(start.heading_rad)
        rotated_first_m = rotation @ first_position_m / start.scale
        first_in_scene_m = np.array([*start.xy_m, ground_m + first_height_m])
        T_scene_world = se3.transform(rotation, first_in_scene_m - rotated_first_m)

        positions_m = (T_scene_world @ _scaled_down(path, start.scale))[:, :3, 3]
        is_free = self._is_free(positions_m, CLEARANCE_M / start.scale)
        return T_scene_world if is_free else None

    def _ground_m(self, xy_m: Array) -> float | None:
        """The height of the lowest level face below a position; None if there is none."""
        z_m = self.high_m[2] + ABOVE_PLACE_M
        ground_m = None
        for _ in range(MAX_LAYERS):
            hits = self.caster.hits(np.array([[*xy_m, z_m]]), DOWN)
            face = hits.face[0]
            if face < 0:
                return ground_m
            z_m -= float(hits.distance[0])
            if self.normals[face, 2] > LEVEL_COSINE:
                ground_m = z_m
            z_m -= BEYOND_FACE_M
        return ground_m

    def _is_open_above(self, xy_m: Array, ground_m: float, height_m: float) -> bool:
        """Whether nothing is above the ground up to a height."""
        above_ground_m = np.array([[*xy_m, ground_m + BEYOND_FACE_M]])
        hits = self.caster.hits(above_ground_m, UP)
        return bool(hits.face[0] < 0 or hits.distance[0] > height_m)

    def _is_free(self, positions_m: Array, clearance_m: float) -> bool:
        """Whether nothing is between or close to the positions (N, 3) of a path, and no object contains them."""
        steps_m = np.diff(positions_m, axis=0)
        between = self.caster.hits(positions_m[:-1], steps_m)
        is_step_blocked = (between.face >= 0) & (between.distance <= 1)
        if is_step_blocked.any():
            return False

        origins_m = np.repeat(positions_m, len(DIRECTIONS_AROUND), axis=0)
        directions = np.tile(DIRECTIONS_AROUND, (len(positions_m), 1))
        hits = self.caster.hits(origins_m, directions)
        is_hit = hits.face >= 0
        if np.any(is_hit & (hits.distance < clearance_m)):
            return False

        # Inside of an object, the back of the face above is visible.
        is_behind = np.einsum("ij,ij->i", self.normals[hits.face], directions) > 0
        is_upward = directions[:, 2] > LEVEL_COSINE
        return not np.any(is_hit & is_behind & is_upward)


# --- Disparities in a scene ---

RAYS_PER_CELL = 7  # along each axis


def segment_disparities(
    caster: RayCaster,
    T_scene_left: Array,
    pair: StereoPair,
    scale: float,
    segments: int,
) -> Array:
    """The median disparity (V, 3, 3) in px by rows and columns of the left view, at the middle of each segment.

    `T_scene_left` (N, 4, 4) is the path in the scene, and `scale` multiplies the distances in it.
    """
    middles = (np.arange(segments) + 0.5) * len(T_scene_left) / segments
    views = T_scene_left[middles.astype(int)]
    rays = _view_rays(pair)  # (R, 3), in the axes of the left camera
    origins_m = np.repeat(views[:, :3, 3], len(rays), axis=0)
    directions = np.concatenate([rays @ T[:3, :3].T for T in views])

    hits = caster.hits(origins_m, directions)
    depth_m = np.where(hits.face >= 0, hits.distance * scale, np.inf)
    disparity_px = pair.focal_baseline / depth_m
    by_cell_px = disparity_px.reshape(len(views), CELLS, RAYS_PER_CELL, CELLS, RAYS_PER_CELL)
    median_px = np.median(by_cell_px, axis=(2, 4))
    return np.asarray(np.maximum(median_px, MIN_DISPARITY_PX))


def _view_rays(pair: StereoPair) -> Array:
    """Rays (R, 3) with depth 1 through a regular grid of the left view, row by row, in the axes of the left camera."""
    camera = pair.left.camera
    rays_per_side = CELLS * RAYS_PER_CELL
    steps = np.arange(rays_per_side) + 0.5
    columns_px = steps * camera.width_px / rays_per_side
    rows_px = steps * camera.height_px / rays_per_side
    u, v = np.meshgrid(columns_px, rows_px)
    homogeneous = np.stack([u, v, np.ones_like(u)], -1).reshape(-1, 3)
    rays = homogeneous @ np.linalg.inv(pair.K).T
    in_camera: Array = rays @ pair.left.R_view_camera
    return in_camera
