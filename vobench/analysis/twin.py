"""A recording repeated in simulation: its path laid into a place, its camera fitted, and how far both agree.

cell       one of 3 x 3 parts of the left view; a place is judged by the median disparity in each, stretch by stretch
scale      how many times as large the place is made; distances in it are looked up with the path so many times smaller
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import scipy
from numpy.typing import NDArray

from vobench.analysis.conditions import chip_noise_dn
from vobench.analysis.realism import edge_px, gradients, noise_dn
from vobench.analysis.stereo_fit import Matches, StereoFit
from vobench.errors import InputError
from vobench.estimator.tools import StereoPair
from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.rendering.geometry import RayCaster
from vobench.scene.scene import Scene, triangles
from vobench.sensor.image_sensor import CameraSensor, CameraSettings
from vobench.sequence.picture import Image
from vobench.trajectory.align import align
from vobench.trajectory.trajectory import Trajectory

CELLS = 3
FEWEST_IN_CELL = 30
LEAST_DISPARITY_PX = 0.3  # what is further away is at infinity


def cell_disparities(fit: StereoFit, pair: StereoPair) -> Array:
    """Median disparity (V, 3, 3) in px of a recording's matches, by rows and columns of the left view; NaN for few.

    V are the stretches along the path that were matched.
    """
    matches: Matches = fit.matches
    offset_px = fit.offset_px.value if fit.offset_px and fit.offset_px.is_plain else 0.0
    uv = np.c_[matches.place, np.ones(len(matches.place))] @ pair.K.T
    column = _cell(uv[:, 0] + matches.disparity_px, pair, 0)
    row = _cell(uv[:, 1], pair, 1)
    cells = np.full((int(matches.window.max()) + 1, CELLS, CELLS), np.nan)
    for window, r, c in np.ndindex(cells.shape):
        inside = (matches.window == window) & (row == r) & (column == c)
        if inside.sum() >= FEWEST_IN_CELL:
            cells[window, r, c] = np.median(matches.disparity_px[inside]) - offset_px
    return np.asarray(np.maximum(cells, LEAST_DISPARITY_PX), float)


def _cell(pixel: Array, pair: StereoPair, axis: int) -> Array:
    camera = pair.left.camera
    size = (camera.width_px, camera.height_px)[axis]
    return np.asarray(np.clip((pixel * CELLS / size).astype(int), 0, CELLS - 1))


# --- The place ---


def levelled(T_world_left: Array) -> Array:
    """A path (N, 4, 4) whose world was the first camera's, turned so that it stays as level as it can."""
    places = T_world_left[:, :3, 3] - T_world_left[:, :3, 3].mean(0)
    floor = places[:, :2].T @ places[:, :2]
    slope = np.linalg.solve(
        floor + 1e-3 * np.trace(floor) * np.eye(2) + 1e-9 * np.eye(2), places[:, :2].T @ places[:, 2]
    )
    normal = np.array([-slope[0], -slope[1], 1.0]) / np.sqrt(1 + slope @ slope)
    axis = np.cross(normal, [0.0, 0.0, 1.0])
    angle = np.arctan2(np.linalg.norm(axis), normal[2])
    turn = scipy.spatial.transform.Rotation.from_rotvec(axis / max(float(np.linalg.norm(axis)), 1e-12) * angle)
    level: Array = se3.transform(turn.as_matrix(), np.zeros(3)) @ T_world_left
    return level


@dataclass(frozen=True, slots=True)
class Placement:
    """Where a path lies in a place: T_place_world, the place's scale, and how far disparities are off (log, mean)."""

    T_place_world: Array
    scale: float
    misfit: float
    tried: int


SCALES = (1.0, 0.7, 1.4, 0.5, 2.0, 0.35, 2.8, 4.0, 5.6)
HEIGHTS_M = (0.3, 0.5, 0.8, 1.2, 1.65, 2.2)
CLEAR_M = 0.3
WAYPOINTS = 40
RAYS = 7
# anywhere, and then ever nearer to the best so far
DRAWS = 6000
NEAR_DRAWS = 1500
# how near at first, and in the end the share of that
NEAR_M = 1.0
NEAR_RAD = 0.3
NEAREST = 0.05
UNSCALED = 0.05  # how much misfit a place of its own size is worth, per factor e


def place_path(scene: Scene, T_world_left: Array, pair: StereoPair, wanted_px: Array, *, seed: int = 0) -> Placement:
    """Lay a path (N, 4, 4) of the left camera into a place so that its disparities agree and nothing is in the way.

    wanted_px (V, 3, 3) are those of V stretches along the path.
    Raises InputError where no way was found that is free.
    """
    faces = triangles(scene, t_ns=0)
    caster = RayCaster(faces)
    facing = faces.plane
    corners = faces.corners_m.reshape(-1, 3)
    low = np.quantile(corners, 0.01, axis=0)
    high = np.quantile(corners, 0.99, axis=0)
    path = _thinned(T_world_left, WAYPOINTS)
    start = path[0, :3, 3]
    rng = np.random.default_rng(seed)
    best = None
    tried = 0
    for nth in range(DRAWS + NEAR_DRAWS):
        drawn = _anywhere(low, high, rng) if nth < DRAWS or best is None else _near(best[1], nth - DRAWS, rng)
        scale, height_m, heading, xy = drawn
        ground = _ground(caster, facing, xy, high[2])
        if ground is None or not _is_open(caster, xy, ground, height_m / scale):
            continue
        T = se3.transform(se3.rotation_z(heading), np.zeros(3))
        lowest_m = float((path[:, 2, 3] - start[2]).min())
        T[:3, 3] = [*xy, ground + (height_m - min(lowest_m, 0.0)) / scale] - T[:3, :3] @ start / scale
        way = T @ np.concatenate([np.concatenate([path[:, :3, :3], path[:, :3, 3:] / scale], 2), path[:, 3:]], 1)
        if not _is_free(caster, facing, way[:, :3, 3], CLEAR_M / scale):
            continue
        tried += 1
        apart = np.abs(np.log(stretch_disparities(caster, way, pair, scale, len(wanted_px)) / wanted_px))
        misfit = float(np.nanmean(apart))
        cost = misfit + UNSCALED * abs(np.log(scale))
        if best is None or cost < best[0]:
            T[:3, 3] *= scale
            best = cost, drawn, Placement(T, scale, misfit, 0)
    if best is None:
        length_m = float(np.linalg.norm(np.diff(T_world_left[:, :3, 3], axis=0), axis=1).sum())
        raise InputError(
            f"no free way of {length_m:.1f} m was found in '{scene.name}'; take fewer pictures or another place"
        )
    return replace(best[2], tried=tried)


Start = tuple[float, float, float, Array]  # scale, height, heading, place (2,)


def _anywhere(low: Array, high: Array, rng: np.random.Generator) -> Start:
    """A start drawn at random: small changes of size more often."""
    scale = SCALES[min(int(rng.exponential(2.5)), len(SCALES) - 1)]
    return scale, float(rng.choice(HEIGHTS_M)), float(rng.uniform(0, 2 * np.pi)), rng.uniform(low[:2], high[:2])


def _near(start: Start, nth: int, rng: np.random.Generator) -> Start:
    """A start near another one, the nearer the later it is drawn."""
    share = NEAREST ** (nth / NEAR_DRAWS)
    scale, height_m, heading, xy = start
    higher, turned, *aside = (share * rng.standard_normal(4)).tolist()
    return scale, height_m * np.exp(NEAR_RAD * higher), heading + NEAR_RAD * turned, xy + NEAR_M * np.array(aside)


def _ground(caster: RayCaster, facing: Array, xy: Array, top_m: float) -> float | None:
    """The lowest level face below a place that is open to above for a body; None where there is none."""
    z = top_m + 1.0
    found = None
    for _ in range(4):
        hits = caster.hits(np.array([[*xy, z]]), np.array([[0.0, 0.0, -1.0]]))
        if hits.face[0] < 0:
            return found
        z -= float(hits.distance[0])
        if facing[hits.face[0], 2] > 0.9:
            found = z
        z -= 1e-3
    return found


def _is_open(caster: RayCaster, xy: Array, ground_m: float, height_m: float) -> bool:
    hits = caster.hits(np.array([[*xy, ground_m + 1e-3]]), np.array([[0.0, 0.0, 1.0]]))
    return bool(hits.face[0] < 0 or hits.distance[0] > height_m)


def _thinned(T: Array, count: int) -> Array:
    return np.asarray(T[np.unique(np.linspace(0, len(T) - 1, count).astype(int))], float)


def _is_free(caster: RayCaster, facing: Array, way_m: Array, clear_m: float) -> bool:
    """Whether nothing lies between places (N, 3), nor nearer to them than clear_m, and they are inside no thing."""
    steps = np.diff(way_m, axis=0)
    hits = caster.hits(way_m[:-1], steps)
    if np.any((hits.face >= 0) & (hits.distance <= 1)):
        return False
    around = np.array([w for w in product((-1, 0, 1), repeat=3) if any(w)], float)
    around /= np.linalg.norm(around, axis=1, keepdims=True)
    origins = np.repeat(way_m, len(around), axis=0)
    ways = np.tile(around, (len(way_m), 1))
    hits = caster.hits(origins, ways)
    met = hits.face >= 0
    if np.any(met & (hits.distance < clear_m)):
        return False
    from_behind = np.einsum("ij,ij->i", facing[hits.face], ways) > 0
    return not np.any(met & from_behind & (ways[:, 2] > 0.9))


def stretch_disparities(caster: RayCaster, way: Array, pair: StereoPair, scale: float, stretches: int) -> Array:
    """Median disparity (V, 3, 3) in px by rows and columns of the left view, amid each stretch of a way (N, 4, 4)."""
    views = way[((np.arange(stretches) + 0.5) * len(way) / stretches).astype(int)]
    camera = pair.left.camera
    u, v = ((np.arange(CELLS * RAYS) + 0.5) * n / (CELLS * RAYS) for n in (camera.width_px, camera.height_px))
    pixels = np.stack(np.meshgrid(u, v), -1).reshape(-1, 2)
    rays = np.c_[pixels, np.ones(len(pixels))] @ np.linalg.inv(pair.K).T
    turn = pair.left.R_view_camera
    origins = np.repeat(views[:, :3, 3], len(rays), axis=0)
    ways = np.concatenate([rays @ turn @ T[:3, :3].T for T in views])
    hits = caster.hits(origins, ways)
    depth_m = np.where(hits.face >= 0, hits.distance * scale, np.inf)
    seen = (pair.focal_baseline / depth_m).reshape(len(views), CELLS, RAYS, CELLS, RAYS)
    return np.asarray(np.maximum(np.median(seen, axis=(2, 4)), LEAST_DISPARITY_PX))


# --- The camera ---


@dataclass(frozen=True, slots=True)
class Look:
    """What a camera is fitted to: mean and standard deviation of grey, noise where flat, and the width of edges.

    `flat_dn` (N,) are the grey values of what is flat.
    """

    mean_dn: float
    sd_dn: float
    noise_dn: float
    edge_px: float
    flat_dn: Array


def look_of(pictures: Sequence[Image]) -> Look:
    """The look of some grey pictures."""
    noises = [noise_dn(picture) for picture in pictures]
    rows = [(p.mean(), p.std(), n[0], edge_px(p, gradients(p))) for p, n in zip(pictures, noises, strict=True)]
    mean_dn, sd_dn, sigma_dn, width_px = np.mean(rows, axis=0).tolist()
    return Look(mean_dn, sd_dn, sigma_dn, width_px, np.concatenate([flat_dn for _, flat_dn in noises]))


Develop = Callable[[CameraSettings], list[Image]]  # the pictures that a camera takes of what is there
WELL_E = 20_000.0
READ_E = 25.0
GAINS = (0.02, 60.0)
GAMMAS = (0.2, 1.2)
BLURS_PX = (0.0, 3.0)
NOISES = (0.03, 30.0)
ROUNDING = 1 / 12  # variance of a grey value that is rounded
ROUNDS = 3
HALVINGS = 7


def camera_of(gain: float, gamma: float, blur_px: float, noise: float) -> CameraSettings:
    """A camera of an exposure, of grey values that go as light ** gamma, a blur, and a chip that is noisy.

    It is `noise` times as noisy as one of 20,000 electrons.
    """
    chip = CameraSensor(
        full_well_e=WELL_E / noise**2, read_noise_e=READ_E / noise, shot_noise=True, adc_bits=10, response=1 / gamma
    )
    return CameraSettings(chip=chip, exposure_gain=gain, blur_sigma_px=blur_px)


def fit_camera(wanted: Look, develop: Develop) -> tuple[CameraSettings, Look]:
    """The camera whose pictures look as wanted, as near as it can, and how they look."""
    gain = 1.0
    gamma = 0.45
    blur_px = 0.0
    noise = 0.05
    for _ in range(ROUNDS):
        gamma = _contrast(blur_px, noise, wanted, develop)
        gain = _exposed(gamma, blur_px, noise, wanted, develop)[0]
        blur_px = _sharpness(gain, gamma, noise, wanted, develop)
        noise = _noisiness(gamma, wanted)
    settings = camera_of(gain, gamma, blur_px, noise)
    return settings, look_of(develop(settings))


def _contrast(blur_px: float, noise: float, wanted: Look, develop: Develop) -> float:
    """The response's exponent."""
    return _solve(lambda gamma: _exposed(gamma, blur_px, noise, wanted, develop)[1], wanted.sd_dn, GAMMAS)


def _sharpness(gain: float, gamma: float, noise: float, wanted: Look, develop: Develop) -> float:
    """The blur in px."""
    return _solve(lambda blur: _look(gain, gamma, blur, noise, develop).edge_px, wanted.edge_px, BLURS_PX)


def _noisiness(gamma: float, wanted: Look) -> float:
    """How many times as noisy the chip is as one of 20,000 electrons, at the grey values of what is flat."""
    if not len(wanted.flat_dn):
        return NOISES[0]
    usual = camera_of(1.0, gamma, 0.0, 1.0).chip
    usual_dn = np.array([chip_noise_dn(usual, grey_dn) for grey_dn in wanted.flat_dn])
    times = max(wanted.noise_dn**2 - ROUNDING, 0.0) ** 0.5 / np.mean(usual_dn**2) ** 0.5
    return float(np.clip(times, *NOISES))


def _look(gain: float, gamma: float, blur_px: float, noise: float, develop: Develop) -> Look:
    return look_of(develop(camera_of(gain, gamma, blur_px, noise)))


def _exposed(gamma: float, blur_px: float, noise: float, wanted: Look, develop: Develop) -> tuple[float, float]:
    """The gain that brings the mean to what is wanted, and the standard deviation there."""

    def pictures(gain: float) -> Image:
        return np.stack(develop(camera_of(gain, gamma, blur_px, noise)))

    gain = _solve(lambda g: float(pictures(g).mean()), wanted.mean_dn, GAINS, log=True)
    return gain, float(np.mean([each.std() for each in pictures(gain)]))


def _solve(of: Callable[[float], float], wanted: float, ends: tuple[float, float], *, log: bool = False) -> float:
    """Where an increasing function is as wanted, within the ends, by halving."""
    low, high = np.log(ends) if log else ends
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        place = float(np.exp(middle)) if log else float(middle)
        if of(place) < wanted:
            low = middle
        else:
            high = middle
    middle = float((low + high) / 2)
    return float(np.exp(middle)) if log else middle


# --- How far both agree ---

SHARES = np.arange(1, 9) / 12  # of the path, the lengths of segments
BLOCKS = 10
DRAWN = 1000
COVERED = 0.95
LOST = 100.0  # percent: what a segment counts that an estimator has not


def segment_errors(gt: Trajectory, est: Trajectory, *, scaled: bool = False) -> Array:
    """Errors (8, N) in percent of segments of 1/12 to 8/12 of the path by the pose they start from.

    NaN stands for no segment, LOST for one that the estimate has no pose of.
    `scaled`: the estimate has no unit of length, and gets the truth's.
    """
    there = np.isin(gt.t_ns, est.t_ns)
    T_est = np.full((len(gt), 4, 4), np.nan)
    T_est[there] = est.T_world_frame[np.searchsorted(est.t_ns, gt.t_ns[there])]
    if scaled and there.sum() > 2:
        fit = align(T_est[there], gt.T_world_frame[there], kind="sim3")
        T_est[:, :3, 3] *= fit.scale
    distance_m = gt.distances_m()
    errors = np.full((len(SHARES), len(gt)), np.nan)
    for row, length_m in enumerate(SHARES * distance_m[-1]):
        ends = np.searchsorted(distance_m, distance_m + length_m)
        starts = np.flatnonzero(ends < len(gt))
        ends = ends[starts]
        errors[row, starts] = LOST
        known = there[starts] & there[ends]
        starts = starts[known]
        ends = ends[known]
        true = se3.inverse(gt.T_world_frame[starts]) @ gt.T_world_frame[ends]
        apart = se3.inverse(true) @ se3.inverse(T_est[starts]) @ T_est[ends]
        lengths_m = distance_m[ends] - distance_m[starts]
        errors[row, starts] = 100 * np.linalg.norm(apart[:, :3, 3], axis=1) / np.maximum(lengths_m, 1e-9)
    return errors


@dataclass(frozen=True, slots=True)
class Agreement:
    """Kendall's tau between two orders of the same estimators, an interval of 95 %, and mean errors by estimator."""

    tau: float
    low: float
    high: float
    errors: Mapping[str, tuple[float, float]]


def agreement(first: Mapping[str, Array], second: Mapping[str, Array], *, seed: int = 0) -> Agreement:
    """How alike two recordings order estimators by their segments' errors (8, N) each.

    The interval is of orders that stretches of the recordings, drawn again and again, would have given.
    """
    names = [name for name in first if name in second]
    if len(names) < 3:
        raise InputError(f"an order needs 3 estimators or more that ran on both, and there are {len(names)}")
    sides = [np.stack([_by_block(side[name]) for name in names]) for side in (first, second)]
    means = [_means(side, np.arange(BLOCKS)) for side in sides]
    rng = np.random.default_rng(seed)
    draws = [_tau(*(_means(side, rng.integers(0, BLOCKS, BLOCKS)) for side in sides)) for _ in range(DRAWN)]
    low, high = np.quantile(draws, [(1 - COVERED) / 2, (1 + COVERED) / 2]).tolist()
    errors = {name: (float(means[0][n]), float(means[1][n])) for n, name in enumerate(names)}
    return Agreement(_tau(*means), low, high, errors)


def _by_block(errors: Array) -> Array:
    """Sums and counts (blocks, 2) of errors, by when their segments start."""
    blocks = np.array_split(errors, BLOCKS, axis=1)
    return np.array([[np.nansum(block), np.isfinite(block).sum()] for block in blocks])


def _means(side: Array, blocks: NDArray[np.int64]) -> Array:
    sums = side[:, blocks].sum(1)
    mean: Array = sums[:, 0] / np.maximum(sums[:, 1], 1)
    return mean


def _tau(first: Array, second: Array) -> float:
    found = float(scipy.stats.kendalltau(first, second).statistic)
    return found if np.isfinite(found) else 0.0
