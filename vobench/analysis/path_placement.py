"""Places the path of a recording into a scene so that the distances of the visible surfaces agree."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from vobench.analysis.free_lanes import Lane, free_lanes
from vobench.analysis.stereo_fit import StereoFit
from vobench.analysis.stereo_matches import Matches
from vobench.errors import InputError
from vobench.estimator.stereo import StereoPair
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.rendering.geometry import RayCaster
from vobench.scene.scene import Scene, triangles
from vobench.scene.triangles import Triangles
from vobench.suite.free_space import FloorMap, floor_map

# --- Disparities of a recording ---

CELLS = 3  # rows and columns of the left view in which disparities are compared
MIN_MATCHES_IN_CELL = 30
MIN_DISPARITY_PX = 0.3  # points that are further away count as infinitely far
TENTHS = (0.1, 0.9)  # quantiles of the disparities of a picture

Cells = NDArray[np.int64]


def cell_disparities(fit: StereoFit, pair: StereoPair) -> Array:
    """The median disparity (V, 3, 3) in px of a recording's matches, by rows and columns of the left view.

    V is the number of segments of the path in which matches were found. NaN for a cell with too few matches.
    """
    segment_of_match, row, column = _cells_of_matches(fit, pair)
    disparity_px = _corrected_disparities(fit)
    segments = int(segment_of_match.max()) + 1
    medians_px = np.full((segments, CELLS, CELLS), np.nan)
    for segment, cell_row, cell_column in np.ndindex(medians_px.shape):
        is_in_cell = (segment_of_match == segment) & (row == cell_row) & (column == cell_column)
        if is_in_cell.sum() >= MIN_MATCHES_IN_CELL:
            medians_px[segment, cell_row, cell_column] = np.median(disparity_px[is_in_cell])
    return np.asarray(np.maximum(medians_px, MIN_DISPARITY_PX), float)


@dataclass(frozen=True, slots=True)
class WantedDisparities:
    """The disparities of a recording in V segments of its path.

    `cells_px` (V, 3, 3) are medians by rows and columns of the left view, NaN for unknown ones. `counts` (V, 3, 3) are
    the numbers of matches. `tenths_px` (V, 2) are the disparities above which 90 % and 10 % of the matches are, NaN if
    there are too few.
    """

    cells_px: Array
    counts: Array
    tenths_px: Array

    @classmethod
    def of_cells(cls, cells_px: Array) -> "WantedDisparities":
        """Disparities of which only the medians of cells are known."""
        segments = len(cells_px)
        return cls(cells_px, np.ones((segments, CELLS, CELLS)), np.full((segments, len(TENTHS)), np.nan))


def wanted_disparities(fit: StereoFit, pair: StereoPair) -> WantedDisparities:
    """The disparities of a recording's matches, without the offset that the pair has."""
    cells_px = cell_disparities(fit, pair)
    segments = len(cells_px)
    segment, row, column = _cells_of_matches(fit, pair)
    counts = np.zeros(cells_px.shape)
    np.add.at(counts, (segment, row, column), 1.0)

    tenths_px = np.full((segments, len(TENTHS)), np.nan)
    disparity_px = _corrected_disparities(fit)
    for index in range(segments):
        of_segment_px = disparity_px[segment == index]
        if len(of_segment_px) >= MIN_MATCHES_IN_CELL:
            tenths_px[index] = np.quantile(of_segment_px, TENTHS)
    return WantedDisparities(cells_px, counts, tenths_px)


def _corrected_disparities(fit: StereoFit) -> Array:
    """The disparities (N,) in px of matches, without the errors that the right camera causes if these are known."""
    matches = fit.matches
    calibrated = fit.calibrated
    if calibrated is None or not calibrated.is_offset_determined:
        return matches.disparity_px
    error_px, _ = calibrated.calibration.disparity_error(_right_px(matches, calibrated.calibration.pair))
    corrected_px: Array = matches.disparity_px - error_px
    return corrected_px


def _right_px(matches: Matches, pair: StereoPair) -> Array:
    """The pixels (N, 2) of matches in the right image."""
    return pair.right.from_view(_right_view_px(matches, pair))


def _right_view_px(matches: Matches, pair: StereoPair) -> Array:
    """The pixels (N, 2) of matches in the right view, in which they have normalised coordinates."""
    homogeneous = np.c_[matches.place, np.ones(len(matches.place))]
    view_px: Array = (homogeneous @ pair.K.T)[:, :2]
    return view_px


def _cells_of_matches(fit: StereoFit, pair: StereoPair) -> tuple[Cells, Cells, Cells]:
    """The segment of each match (N,), and its row and column in the left view."""
    matches = fit.matches
    camera = pair.left.camera
    # Rectified views show a point in the same row, and the left view shows it further right by the disparity.
    right_px = _right_view_px(matches, pair)
    left_column_px = right_px[:, 0] + matches.disparity_px
    row = _cell(right_px[:, 1], camera.height_px)
    column = _cell(left_column_px, camera.width_px)
    return matches.window, row, column


def _cell(pixel: Array, size_px: int) -> Cells:
    """The index of the cell (N,) of pixels (N,) along one axis."""
    number = (pixel * CELLS / size_px).astype(np.int64)
    return np.clip(number, 0, CELLS - 1)


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
    """The pose of a path in a place, the scale of the place, and how well the disparities agree.

    `scale` is the factor by which the place is enlarged. `misfit` is the mean error of log disparities. `nearness` is
    the largest ratio of a tenth of a picture's disparities to that of the recording. `tried` is the number of free
    paths that were compared.
    """

    T_place_world: Array
    scale: float
    misfit: float
    nearness: float
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


@dataclass(frozen=True, slots=True)
class PlacementLimits:
    """The scales of a place that are tried, group by group until one fits, and the largest nearness."""

    scales: tuple[tuple[float, ...], ...]
    nearness: float


# A twin needs the recording's own scale, and nothing nearer than in the recording.
OWN_SCALE = PlacementLimits(((1.0, 0.9, 1.1, 0.8, 1.2),), 1.5)
ANY_SCALE = PlacementLimits(((1.0, 0.85, 1.2), (0.7, 1.4), (0.5, 2.0), (0.35, 2.8), (4.0, 5.6)), np.inf)

HEIGHTS_M = (0.3, 0.5, 0.8, 1.2, 1.65, 2.2)
CLEARANCE_M = 0.3
BODIES_M = (0.6, 0.9, 1.2, 1.5, 2.0, 2.5)  # heights up to which the floor along a path may have to be free
WAYPOINTS = 40
LANES = 40  # that are tried at each scale
MAX_LAYERS = 4  # faces below a point that are examined
EXTENT_QUANTILE = 0.01  # of the corners of faces: a few far ones do not extend the place

UP = np.array([[0.0, 0.0, 1.0]])
DOWN = -UP
LEVEL_COSINE = 0.9  # a face is level if the cosine of the angle between its normal and the vertical is larger
BEYOND_FACE_M = 1e-3
ABOVE_PLACE_M = 1.0

# The draws closer and closer to a candidate.
NEAR_DRAWS = 120
MORE_IMPROVED = 4  # candidates, besides as many as are wanted
NEAR_M = 1.0
NEAR_RAD = 0.3  # of the heading, and of the logarithm of the height
LAST_SHARE = 0.05  # of these distances, at the last draw
SCALE_COST = 0.05  # misfit that is worth a factor e of the scale
NEARNESS_COST = 3.0  # misfit that is worth a factor e of the nearness beyond the limit
# Two placements differ if the middle of the path moves by this share of its extent, or if it turns by this angle.
DISTINCT_SHARE = 0.25
DISTINCT_RAD = np.deg2rad(30)


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
class _Candidate:
    """A start at which a path is free, its placement, and the position (2,) of the middle of the path there."""

    cost: float
    start: _Start
    placement: Placement
    middle_m: Array

    def differs_from(self, other: "_Candidate", extent_m: float) -> bool:
        """Whether two candidates are different placements of a path."""
        turn_rad = abs(np.angle(np.exp(1j * (self.start.heading_rad - other.start.heading_rad))))
        moved_m = float(np.linalg.norm(self.middle_m - other.middle_m))
        return moved_m > DISTINCT_SHARE * extent_m or turn_rad > DISTINCT_RAD


def place_path(
    scene: Scene,
    T_world_left: Array,
    pair: StereoPair,
    wanted: WantedDisparities,
    *,
    limits: PlacementLimits = OWN_SCALE,
    most: int = 1,
    seed: int = 0,
) -> list[Placement]:
    """The best different placements of a path (N, 4, 4) of the left camera in a scene, the best one first.

    The path is free there, its disparities agree, and nothing is nearer than the limits allow.
    Raises InputError, with the reason, if there is none.
    """
    search = _Search(_Surroundings.of(scene), _thinned(T_world_left, WAYPOINTS), pair, wanted, limits)
    reason = ""
    for scales in limits.scales:
        candidates = search.along_lanes(scales)
        found = search.best_of(candidates, most, np.random.default_rng(seed))
        if found:
            return [replace(each.placement, tried=len(candidates)) for each in found]
        reason = search.reason(candidates, scales)
    steps_m = np.diff(T_world_left[:, :3, 3], axis=0)
    length_m = float(np.linalg.norm(steps_m, axis=1).sum())
    raise InputError(
        f"no free path of {length_m:.1f} m was found in '{scene.name}' ({reason}); take fewer images or another place"
    )


@dataclass(frozen=True, slots=True)
class _Search:
    """The search for placements of a path (W, 4, 4) in a scene."""

    surroundings: "_Surroundings"
    path: Array
    pair: StereoPair
    wanted: WantedDisparities
    limits: PlacementLimits

    def along_lanes(self, scales: tuple[float, ...]) -> list[_Candidate]:
        """The candidates on free lanes of the floor, at some scales and at all heights."""
        candidates = []
        for scale, height_m in product(scales, HEIGHTS_M):
            for lane in self._lanes(scale, height_m):
                candidate = self.judged(_Start(scale, height_m, lane.heading_rad, lane.xy_m))
                if candidate is not None:
                    candidates.append(candidate)
        return candidates

    def _lanes(self, scale: float, height_m: float) -> list[Lane]:
        """The free lanes of the floor for a height of the path."""
        floor = self.surroundings.floor((height_m + CLEARANCE_M) / scale)
        if floor is None:
            return []
        return free_lanes(floor, self.path[:, :2, 3] / scale, clearance_m=CLEARANCE_M / scale, most=LANES)

    def judged(self, start: _Start) -> _Candidate | None:
        """The candidate at a start; None if the path is not free there."""
        T_scene_world = self.surroundings.free_pose(self.path, start)
        if T_scene_world is None:
            return None
        path_in_scene = T_scene_world @ _scaled_down(self.path, start.scale)
        caster = self.surroundings.caster
        misfit = misfit_of(caster, path_in_scene, self.pair, start.scale, self.wanted)
        nearness = nearness_of(caster, path_in_scene, self.pair, start.scale, self.wanted)
        excess = np.log(max(nearness / self.limits.nearness, 1.0))
        cost = misfit + SCALE_COST * abs(np.log(start.scale)) + NEARNESS_COST * excess
        T_place_world = _scaled_up(T_scene_world, start.scale)
        placement = Placement(T_place_world, start.scale, misfit, nearness, tried=0)
        return _Candidate(cost, start, placement, path_in_scene[len(path_in_scene) // 2, :2, 3])

    def best_of(self, candidates: list[_Candidate], most: int, rng: np.random.Generator) -> list[_Candidate]:
        """The best different candidates within the limits, improved by draws near them."""
        improved = [self._improved(candidate, rng) for candidate in self._different(candidates, most + MORE_IMPROVED)]
        within = [each for each in improved if each.placement.nearness <= self.limits.nearness]
        return self._different(within, most)

    def _different(self, candidates: list[_Candidate], most: int) -> list[_Candidate]:
        """The best candidates that differ from each other, at most so many, the best one first."""
        extent_m = float(np.linalg.norm(np.ptp(self.path[:, :2, 3], axis=0)))
        chosen = list[_Candidate]()
        for candidate in sorted(candidates, key=lambda each: each.cost):
            if len(chosen) == most:
                break
            if all(candidate.differs_from(other, extent_m / candidate.start.scale) for other in chosen):
                chosen.append(candidate)
        return chosen

    def _improved(self, best: _Candidate, rng: np.random.Generator) -> _Candidate:
        """The best of draws at a decreasing distance from a candidate."""
        for draw in range(NEAR_DRAWS):
            share = LAST_SHARE ** (draw / NEAR_DRAWS)
            near = self.judged(best.start.near(share, rng))
            if near is not None and near.cost < best.cost:
                best = near
        return best

    def reason(self, candidates: list[_Candidate], scales: tuple[float, ...]) -> str:
        """Why there is no placement at some scales."""
        span = f"{min(scales):g} to {max(scales):g}"
        if not candidates:
            return f"it fits nowhere at scales of {span}"
        nearness = min(candidate.placement.nearness for candidate in candidates)
        return f"on {len(candidates)} free lanes, surfaces are {nearness:.1f} times as near as in the recording or more"


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
    """The scene that a path is placed into: its faces, ray caster, upper end, and maps of the floor by height."""

    faces: Triangles
    caster: RayCaster
    top_m: float
    floors: dict[float, FloorMap | None]

    @classmethod
    def of(cls, scene: Scene) -> "_Surroundings":
        faces = triangles(scene, t_ns=0)
        heights_m = faces.corners_m[..., 2]
        top_m = float(np.quantile(heights_m, 1 - EXTENT_QUANTILE))
        return cls(faces, RayCaster(faces), top_m, {})

    def floor(self, height_m: float) -> FloorMap | None:
        """The map of where the floor is free up to a height or a little more; None if there is no floor."""
        body_m = next((body_m for body_m in BODIES_M if body_m >= height_m), BODIES_M[-1])
        if body_m not in self.floors:
            self.floors[body_m] = floor_map(self.faces, self.caster, body_m=body_m)
        return self.floors[body_m]

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
        z_m = self.top_m + ABOVE_PLACE_M
        ground_m = None
        for _ in range(MAX_LAYERS):
            hits = self.caster.hits(np.array([[*xy_m, z_m]]), DOWN)
            face = hits.face[0]
            if face < 0:
                return ground_m
            z_m -= float(hits.distance[0])
            if self.faces.plane[face, 2] > LEVEL_COSINE:
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
        is_behind = np.einsum("ij,ij->i", self.faces.plane[hits.face], directions) > 0
        is_upward = directions[:, 2] > LEVEL_COSINE
        return not np.any(is_hit & is_behind & is_upward)


# --- Disparities in a scene ---

RAYS_PER_CELL = 5  # along each axis
NEARNESS_VIEWS = 12
NEAREST_COMPARED_PX = 1.0  # smaller disparities of a recording count as this one


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
    disparity_px = _ray_disparities(caster, T_scene_left[middles.astype(int)], pair, scale)
    median_px = np.median(np.nan_to_num(disparity_px, nan=0.0), axis=-1)
    return np.asarray(np.maximum(median_px, MIN_DISPARITY_PX))


def misfit_of(
    caster: RayCaster,
    T_scene_left: Array,
    pair: StereoPair,
    scale: float,
    wanted: WantedDisparities,
) -> float:
    """The mean error of log disparities of a path (N, 4, 4) in a scene, as in `Placement`."""
    seen_px = segment_disparities(caster, T_scene_left, pair, scale, len(wanted.cells_px))
    return float(np.nanmean(np.abs(np.log(seen_px / wanted.cells_px))))


def nearness_of(
    caster: RayCaster,
    T_scene_left: Array,
    pair: StereoPair,
    scale: float,
    wanted: WantedDisparities,
) -> float:
    """The largest ratio of a tenth of a view's disparities to that of the recording, over views along a path (N, 4, 4).

    Rays count as often as the recording has matches in their cell, and not at all if they meet no surface. 0 if the
    tenths are unknown.
    """
    views = np.linspace(0, len(T_scene_left) - 1, NEARNESS_VIEWS).astype(int)
    disparity_px = _ray_disparities(caster, T_scene_left[views], pair, scale)
    segments = len(wanted.tenths_px)
    ratios = [0.0]
    for index, of_view_px in enumerate(disparity_px):
        segment = index * segments // NEARNESS_VIEWS
        tenths_px = _weighted_tenths(of_view_px, wanted.counts[segment])
        ratios += (tenths_px / np.maximum(wanted.tenths_px[segment], NEAREST_COMPARED_PX)).tolist()
    return float(np.nanmax(ratios))


def _weighted_tenths(disparity_px: Array, counts: Array) -> Array:
    """The TENTHS (2,) of the disparities (3, 3, R) of a view, of which each cell counts by its `counts` (3, 3)."""
    is_hit = np.isfinite(disparity_px)
    hits = is_hit.sum(-1)
    weights = np.broadcast_to((counts / np.maximum(hits, 1))[..., None], disparity_px.shape)[is_hit]
    values_px = disparity_px[is_hit]
    if not weights.sum():
        return np.zeros(len(TENTHS))
    order = np.argsort(values_px)
    share = np.cumsum(weights[order]) / weights.sum()
    rows = np.minimum(np.searchsorted(share, TENTHS), len(order) - 1)
    return np.asarray(values_px[order][rows])


def _ray_disparities(caster: RayCaster, views: Array, pair: StereoPair, scale: float) -> Array:
    """The disparities (V, 3, 3, R) of rays in each cell of views (V, 4, 4) in a scene; NaN where they meet nothing."""
    rays = _view_rays(pair)  # in the axes of the left camera
    origins_m = np.repeat(views[:, :3, 3], len(rays), axis=0)
    directions = np.concatenate([rays @ T[:3, :3].T for T in views])
    hits = caster.hits(origins_m, directions)
    depth_m = np.where(hits.face >= 0, hits.distance * scale, np.nan)
    by_cell_px = (pair.focal_baseline / depth_m).reshape(len(views), CELLS, RAYS_PER_CELL, CELLS, RAYS_PER_CELL)
    return np.moveaxis(by_cell_px, 2, 3).reshape(len(views), CELLS, CELLS, RAYS_PER_CELL**2)


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
