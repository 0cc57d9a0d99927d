"""Drives at random through the free space of a place, with the speeds, turns and stops of a body.

A path consists of clothoids that are laid end to end, so that its curvature is continuous and all derivatives of the
motion are exact. Each is drawn among those that keep the body clear of everything, and leads towards a goal that is
drawn in the free space; another goal follows when one is reached.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
import scipy
from annotated_types import Ge, Gt, Le
from numpy.typing import NDArray

from vobench.errors import MotionError
from vobench.geometry.rig import PIONEER_WHEELS, Mount, WheelGeometry
from vobench.geometry.se3 import Array
from vobench.motion.ackermann import ACKERMANNS, ackermann
from vobench.motion.course import Course, CoursePiece, course
from vobench.motion.ground_curve import GroundCurve, over_ground
from vobench.motion.handheld import SHAKES, HandheldMotion, draw_shake
from vobench.motion.quadrotor import Quadrotor
from vobench.motion.spline import Pose
from vobench.motion.wheeled import CAR_WHEELS, Rate, Speed
from vobench.setting import settings
from vobench.trajectory.kinematics import CurveMotion, Kinematics, Motion, TimeLaw, level, through_speeds
from vobench.trajectory.nanoseconds import NS_PER_S
from vobench.trajectory.trajectory import Stamps

Body = Literal["pioneer", "car", "hand", "quadrotor"]
WHEELED_BODIES = ("pioneer", "car")
CAR = "kitti_like"


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyHabits:
    """How a body moves, and the space that it takes.

    discs_m: where discs of radius_m lie along the body's x axis; together they cover it. margin_m: what a planned path
    keeps clear beyond that. column_m: the height above the floor that has to be free.
    speed_mps: the range in which speeds are drawn. The lateral acceleration and the yaw rate limit them in bends.
    stop_every_m: the mean distance between stops, 0 for none. stop_s: the range of their durations.
    """

    radius_m: float
    discs_m: tuple[float, ...]
    margin_m: float
    column_m: float
    step_m: float
    turn_radius_m: float
    speed_mps: tuple[float, float]
    accel_mps2: float
    lateral_mps2: float
    yaw_radps: float
    stop_every_m: float = 0.0
    stop_s: tuple[float, float] = (0.5, 2.0)


# Engineering choices. The Pioneer is 0.4 m wide. The car is that of KITTI, with the middle of the rear axle as its
# origin. People walk slowly where they look around; a hand neither stops nor turns on the spot.
HABITS: dict[str, BodyHabits] = {
    "pioneer": BodyHabits(
        radius_m=0.25,
        discs_m=(0.0,),
        margin_m=0.05,
        column_m=0.6,
        step_m=0.25,
        turn_radius_m=0.35,
        speed_mps=(0.25, 0.6),
        accel_mps2=0.5,
        lateral_mps2=0.5,
        yaw_radps=1.2,
        stop_every_m=5.0,
    ),
    "car": BodyHabits(
        radius_m=1.05,
        discs_m=(0.0, 1.35, 2.7),
        margin_m=0.15,
        column_m=1.7,
        step_m=1.5,
        turn_radius_m=6.0,
        speed_mps=(4.0, 10.0),
        accel_mps2=1.8,
        lateral_mps2=2.5,
        yaw_radps=0.6,
        stop_every_m=80.0,
        stop_s=(1.0, 3.0),
    ),
    "hand": BodyHabits(
        radius_m=0.25,
        discs_m=(0.0,),
        margin_m=0.05,
        column_m=1.9,
        step_m=0.35,
        turn_radius_m=0.45,
        speed_mps=(0.6, 1.1),
        accel_mps2=0.6,
        lateral_mps2=0.9,
        yaw_radps=1.6,
    ),
    "quadrotor": BodyHabits(
        radius_m=0.25,
        discs_m=(0.0,),
        margin_m=0.15,
        column_m=1.9,
        step_m=0.4,
        turn_radius_m=0.8,
        speed_mps=(0.5, 1.2),
        accel_mps2=0.8,
        lateral_mps2=1.5,
        yaw_radps=1.5,
    ),
}
HAND_HEIGHT_M = (1.35, 1.55)
HAND_PITCH_DEG = (2.0, 10.0)
FLIGHT_HEIGHT_M = (0.7, 1.5)
FLIGHT_POINT_M = 1.2  # about the distance between points of a flight
GROUND_STEP_M = 0.4  # between heights of uneven ground under a path

# The search.
BENDS = 9  # curvatures among which each is drawn
SAMPLES = 5  # on a step, at which it is checked
ATTEMPTS = 60  # starts
EXPANSIONS = 40  # of an attempt, for each step of the path
STARTS = 12  # of which the one with the longest way ahead is taken
LOOK_AHEAD_M = 6.0
GOAL_M = 0.8  # a goal is reached at this distance, or at a turn radius
NEAREST_GOAL_M = 2.0
NOISE_M = 0.15  # of the choice among bends, per metre of a step
OPEN_M = 1.0  # more clearance is not preferred
ROOM_SHARE = 0.3  # of a metre on the way to the goal, which a metre of clearance is worth
LEVEL_STEPS = 3  # of the path, at least, between changes of speed
CHECKS_PER_M = 20


@dataclass(frozen=True, slots=True)
class Clearance:
    """The distance (H, W) in m from cells of a floor to the nearest one that is not free; 0 in those.

    The centre of the first cell is at x_m, y_m. The floor is at floor_m, or at ground_m (H, W) where it is uneven.
    """

    x_m: float
    y_m: float
    floor_m: float
    cell_m: float
    distance_m: Array
    ground_m: Array | None = None

    def ground_at(self, points_m: Array) -> Array:
        """The height (N,) of the floor or ground at points (N, 2), linear between centres of cells."""
        if self.ground_m is None:
            return np.full(len(points_m), self.floor_m)
        column = (points_m[:, 0] - self.x_m) / self.cell_m
        row = (points_m[:, 1] - self.y_m) / self.cell_m
        height_m: Array = scipy.ndimage.map_coordinates(self.ground_m, [row, column], order=1, mode="nearest")
        return height_m

    def at(self, points_m: Array) -> Array:
        """The distance (...) at points (..., 2), linear between centres of cells; 0 beyond the floor."""
        column = (points_m[..., 0] - self.x_m) / self.cell_m
        row = (points_m[..., 1] - self.y_m) / self.cell_m
        interpolated = scipy.ndimage.map_coordinates(self.distance_m, [row.ravel(), column.ravel()], order=1, cval=0.0)
        distance_m: Array = interpolated.reshape(row.shape)
        return distance_m

    def centre(self, cell: int) -> Array:
        """The centre (2,) of the cell with a number, row by row."""
        row, column = divmod(cell, self.distance_m.shape[1])
        return np.array([self.x_m + column * self.cell_m, self.y_m + row * self.cell_m])


@settings()
class Wander:
    """A drive at random through the free space of its place; another seed is another drive.

    `seeds` is the number of drives, with seeds from `seed` on, plus the base seed of the suite. A hand holds the body
    at about 1.45 m, and a quadrotor flies 0.7 to 1.5 m above the floor: their cameras should have height_m 0. The
    wheels of pioneer and car roll without slip. On uneven ground, such as that of a park, a pioneer tilts with the
    ground, which is smoothed over half a metre, and there are no cars.
    """

    kind: Literal["wander"] = "wander"
    body: Body = "pioneer"
    length_m: Annotated[float, Gt(0), Le(2000)]
    seed: Annotated[int, Ge(0), Le(2**31 - 1)] = 1
    seeds: Annotated[int, Ge(1), Le(1000)] | None = None
    speed_mps: Speed | None = None
    rate_hz: Rate = 30.0
    encoders: Literal["exact", "nominal"] = "nominal"
    mount: Mount | None = None

    @property
    def habits(self) -> BodyHabits:
        """How the body moves; with a speed, around that speed."""
        habits = HABITS[self.body]
        if self.speed_mps is None:
            return habits
        return replace(habits, speed_mps=(0.7 * self.speed_mps, self.speed_mps))

    @property
    def wheels(self) -> WheelGeometry | None:
        """The nominal geometry of the wheels that are not steered; None for a body without wheels."""
        if self.body == "pioneer":
            return PIONEER_WHEELS
        return CAR_WHEELS[CAR] if self.body == "car" else None

    def motion(self, clearance: Clearance) -> "WanderMotion":
        """The drive of the seed in a place.

        Raises MotionError if there is no room for it, and for a car on uneven ground.
        """
        if self.body == "car" and clearance.ground_m is not None:
            raise MotionError(
                "the ground of this place is uneven, where a car does not wander; choose body pioneer, hand or "
                "quadrotor, or a rail through points on the ground"
            )
        rng = np.random.default_rng(self.seed)
        for _ in range(ATTEMPTS):
            planned = _planned(clearance, self.habits, self.length_m, rng)
            if planned is None:
                continue
            motion = _moved(self, clearance, planned, rng)
            clear_m = least_clearance_m(motion, clearance, self.habits)
            if clear_m > 0:
                return WanderMotion(motion, clear_m)
        raise MotionError(
            f"no path of {self.length_m:g} m was found on which a {self.body} with seed {self.seed} keeps clear of "
            "everything; choose a shorter one, another body or a larger place"
        )


@dataclass(frozen=True, slots=True)
class WanderMotion:
    """A drive, and the least distance between the body and anything else."""

    motion: Motion
    clearance_m: float


@dataclass(frozen=True, slots=True)
class PlannedPath:
    """A path on the floor: its start (x, y, heading), pieces, and the curve that these are."""

    start: Array
    pieces: tuple[CoursePiece, ...]
    curve: Course

    @property
    def T_world_start(self) -> Array:
        """The pose (4, 4) of the start on the floor z = 0."""
        x_m, y_m, heading_rad = self.start[:, None]
        T: Array = level(x_m, y_m, heading_rad)[0]
        return T

    @property
    def length_m(self) -> float:
        """The length of the path."""
        return sum(piece.length for piece in self.pieces)

    def points_m(self, s: Array) -> Array:
        """Points (N, 2) of the path at arc lengths (N,)."""
        T = self.T_world_start @ self.curve.at(s).T_world_body
        points: Array = T[:, :2, 3]
        return points


# Planning


def _planned(clearance: Clearance, habits: BodyHabits, length_m: float, rng: np.random.Generator) -> PlannedPath | None:
    """A path that keeps clear of everything; None if none is found from the start that is drawn."""
    is_free = clearance.distance_m >= habits.radius_m + habits.margin_m
    region = _region(is_free, rng)
    if region is None:
        return None
    count = max(int(np.ceil(length_m / habits.step_m)), 2)
    step_m = length_m / count
    start = _drawn_start(clearance, region, habits, rng)
    steps = _Steps(clearance, habits, step_m, _Goals(clearance, region, rng), rng)
    bends = steps.drawn(start, count)
    if bends is None:
        return None
    pieces = []
    for bend, next_bend in pairwise(bends):
        pieces.append(CoursePiece(step_m, bend, (next_bend - bend) / step_m))
    return PlannedPath(start, tuple(pieces), course(pieces))


def _region(is_free: NDArray[np.bool_], rng: np.random.Generator) -> NDArray[np.intp] | None:
    """The numbers of the cells of one connected region, drawn by area; None if nothing is free."""
    labels, count = scipy.ndimage.label(is_free, structure=np.ones((3, 3)))
    if count == 0:
        return None
    areas = np.bincount(labels.ravel())[1:].astype(float)
    label = 1 + rng.choice(count, p=areas**2 / (areas**2).sum())
    return np.flatnonzero(labels == label)


def _drawn_start(clearance: Clearance, region: NDArray[np.intp], habits: BodyHabits, rng: np.random.Generator) -> Array:
    """A start (x, y, heading) in a region: of several that are drawn, the one with the longest way ahead."""
    candidates = []
    reaches_m = []
    along_m = np.arange(0.0, LOOK_AHEAD_M + 2 * habits.turn_radius_m, clearance.cell_m)
    for cell in rng.choice(region, STARTS):
        heading = rng.uniform(-np.pi, np.pi)
        ahead = np.array([np.cos(heading), np.sin(heading)])
        position_m = clearance.centre(int(cell))
        is_blocked = clearance.at(position_m + along_m[:, None] * ahead) < habits.radius_m
        reaches_m.append(along_m[np.argmax(is_blocked)] if is_blocked.any() else along_m[-1])
        candidates.append(np.array([*position_m, heading]))
    return candidates[int(np.argmax(reaches_m))]


class _Goals:
    """Goals in a region, one after the other, and the length of the shortest path (H, W) to the present one."""

    def __init__(self, clearance: Clearance, region: NDArray[np.intp], rng: np.random.Generator) -> None:
        self._clearance = clearance
        self._region = region
        self._rng = rng
        self._graph = _grid_graph(clearance, region)
        self._length_m: Array | None = None

    def drop(self) -> None:
        """Give the present goal up."""
        self._length_m = None

    def renew(self, pose: Array, reached_m: float) -> None:
        """Draw another goal if there is none, or if the present one is reached."""
        if self._length_m is not None and self.length_m(pose[None, :2])[0] > reached_m:
            return
        for _ in range(STARTS):
            goal = int(self._rng.integers(len(self._region)))
            from_goal_m = scipy.sparse.csgraph.dijkstra(self._graph, indices=goal)
            farthest_m = float(from_goal_m[np.isfinite(from_goal_m)].max())
            length_m = np.full(self._clearance.distance_m.size, farthest_m + 1.0)
            length_m[self._region] = np.minimum(from_goal_m, farthest_m + 1.0)
            self._length_m = length_m.reshape(self._clearance.distance_m.shape)
            if self.length_m(pose[None, :2])[0] > max(NEAREST_GOAL_M, 2 * reached_m):
                return

    def length_m(self, points_m: Array) -> Array:
        """The length (N,) of the shortest path from points (N, 2) to the goal."""
        assert self._length_m is not None
        return replace(self._clearance, distance_m=self._length_m).at(points_m)


def _grid_graph(clearance: Clearance, region: NDArray[np.intp]) -> "scipy.sparse.csr_array":
    """The graph of the cells of a region, with the distances between neighbours, longer where there is less room."""
    shape = clearance.distance_m.shape
    number = np.full(shape, -1)
    number.ravel()[region] = np.arange(len(region))
    padded = np.pad(number, 1, constant_values=-1)
    cost = 1 + 0.3 / np.maximum(clearance.distance_m.ravel()[region], clearance.cell_m)
    starts = []
    ends = []
    lengths_m = []
    for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
        shifted = padded[1 + down : 1 + down + shape[0], 1 + right : 1 + right + shape[1]]
        is_edge = (number >= 0) & (shifted >= 0)
        start = number[is_edge]
        end = shifted[is_edge]
        starts.append(start)
        ends.append(end)
        lengths_m.append(np.hypot(down, right) * clearance.cell_m * (cost[start] + cost[end]) / 2)
    start = np.concatenate(starts)
    end = np.concatenate(ends)
    length_m = np.concatenate(lengths_m)
    edges = (np.concatenate([start, end]), np.concatenate([end, start]))
    return scipy.sparse.csr_array((np.concatenate([length_m, length_m]), edges), (len(region), len(region)))


@dataclass(frozen=True, slots=True)
class _Steps:
    """Draws the steps of a path, each a clothoid of step_m on which the body keeps clear."""

    clearance: Clearance
    habits: BodyHabits
    step_m: float
    goals: "_Goals"
    rng: np.random.Generator

    def drawn(self, start: Array, count: int) -> list[float] | None:
        """The curvatures at the ends of a number of steps from a start (x, y, heading); None if it gets stuck."""
        poses = [start]
        bends = [0.0]
        failures = 0
        for _ in range(EXPANSIONS * count):
            if len(poses) > count:
                return bends
            self.goals.renew(poses[-1], max(GOAL_M, self.habits.turn_radius_m))
            chosen = self._next(poses[-1], bends[-1])
            if chosen is not None:
                pose, bend = chosen
                poses.append(pose)
                bends.append(bend)
                continue
            # Go back, the further the more often that happened, and look for another way on.
            failures += 1
            back = min(1 + failures, len(poses) - 1)
            del poses[len(poses) - back :]
            del bends[len(bends) - back :]
            self.goals.drop()
        return None

    def _next(self, pose: Array, bend: float) -> tuple[Array, float] | None:
        """The pose and the curvature at the end of the next step; None if the body gets stuck whatever it does."""
        sharpest = 1 / self.habits.turn_radius_m
        next_bends = np.linspace(-sharpest, sharpest, BENDS)
        next_bends = next_bends[np.abs(next_bends - bend) <= sharpest + 1e-9]
        paths = _step_poses(pose, bend, next_bends, self.step_m)  # (B, SAMPLES, 3)
        needed_m = self.habits.radius_m + self.habits.margin_m
        clear_m = body_clearance_m(self.clearance, paths, self.habits).min(1)
        is_clear = clear_m >= needed_m
        if not is_clear.any():
            return None

        ends = paths[is_clear, -1]
        # Not only where the step ends counts, but also where the body heads for then.
        directions = np.stack([np.cos(ends[:, 2]), np.sin(ends[:, 2])], -1)
        ahead_m = ends[:, :2] + self.habits.turn_radius_m * directions
        to_goal_m = self.goals.length_m(ends[:, :2]) + self.goals.length_m(ahead_m)
        room_ahead_m = np.minimum(self.clearance.at(ahead_m), OPEN_M)
        noise_m = self.rng.normal(0.0, NOISE_M * self.step_m, len(ends))
        best = int(np.argmin(to_goal_m - ROOM_SHARE * room_ahead_m + noise_m))
        return ends[best], float(next_bends[is_clear][best])


def _step_poses(pose: Array, bend: float, next_bends: Array, step_m: float) -> Array:
    """Poses (B, SAMPLES, 3) along clothoids from a pose to each of the curvatures (B,), the last at the end."""
    s = step_m * (np.arange(SAMPLES) + 1) / SAMPLES
    steps = []
    for next_bend in next_bends.tolist():
        curve = course([CoursePiece(step_m, bend, (next_bend - bend) / step_m)])
        T = curve.at(s).T_world_body
        heading = np.arctan2(T[:, 1, 0], T[:, 0, 0])
        steps.append(np.stack([T[:, 0, 3], T[:, 1, 3], heading], -1))
    local = np.stack(steps)
    cosine = np.cos(pose[2])
    sine = np.sin(pose[2])
    x_m = pose[0] + cosine * local[..., 0] - sine * local[..., 1]
    y_m = pose[1] + sine * local[..., 0] + cosine * local[..., 1]
    return np.stack([x_m, y_m, pose[2] + local[..., 2]], -1)


def body_clearance_m(clearance: Clearance, poses: Array, habits: BodyHabits) -> Array:
    """The least distance (...) from the middles of the discs of a body at poses (..., 3) to what is not free."""
    ahead = np.stack([np.cos(poses[..., 2]), np.sin(poses[..., 2])], -1)
    by_disc = [clearance.at(poses[..., :2] + disc_m * ahead) for disc_m in habits.discs_m]
    least_m: Array = np.min(by_disc, axis=0)
    return least_m


def least_clearance_m(motion: Motion, clearance: Clearance, habits: BodyHabits) -> float:
    """The least distance between a moving body and what is not free; negative if it runs into that."""
    fastest_mps = habits.speed_mps[1]
    count = int((motion.end_ns - motion.start_ns) / NS_PER_S * fastest_mps * CHECKS_PER_M) + 2
    poses = planar_poses(motion, count)
    return float(body_clearance_m(clearance, poses, habits).min() - habits.radius_m)


def planar_poses(motion: Motion, count: int) -> Array:
    """The poses (count, 3) of a moving body, as x and y in m and heading in rad, at evenly spaced times."""
    T = motion.at(np.linspace(motion.start_ns, motion.end_ns, count)).T_world_body
    return np.stack([T[:, 0, 3], T[:, 1, 3], np.arctan2(T[:, 1, 0], T[:, 0, 0])], -1)


# Motion along a path


@dataclass(frozen=True, slots=True)
class Placed:
    """Another motion, lifted by a height, of a body that is fixed to the other's body at T_body_mount (4, 4)."""

    motion: Motion
    lift_m: float
    T_body_mount: Array

    @property
    def start_ns(self) -> int:
        """The first instant."""
        return self.motion.start_ns

    @property
    def end_ns(self) -> int:
        """The last instant."""
        return self.motion.end_ns

    @property
    def breaks_ns(self) -> Array:
        """The times at which the acceleration may jump."""
        return self.motion.breaks_ns

    def at(self, t_ns: Stamps | Array) -> Kinematics:
        """The kinematics (K,) at instants."""
        mounted = self.motion.at(t_ns).of_mounted(self.T_body_mount)
        T_world_body = mounted.T_world_body.copy()
        T_world_body[:, 2, 3] += self.lift_m
        return replace(mounted, T_world_body=T_world_body)


def _moved(spec: Wander, clearance: Clearance, path: PlannedPath, rng: np.random.Generator) -> Motion:
    """The motion of the body of a drive along a path."""
    habits = spec.habits
    if spec.body == "quadrotor":
        return _flown(path, habits, clearance, rng)
    law = _law(path, habits, rng)
    if clearance.ground_m is not None:
        curve = _over_ground(path, clearance, is_level=spec.body == "hand")
        on_ground = CurveMotion(curve, law, path.T_world_start)
        return _carried(on_ground, 0.0, rng) if spec.body == "hand" else on_ground
    target = CurveMotion(path.curve, law, path.T_world_start)
    if spec.body == "hand":
        return _carried(target, clearance.floor_m, rng)
    driven: Motion = ackermann(target, ACKERMANNS[CAR]) if spec.body == "car" else target
    return Placed(driven, clearance.floor_m, np.eye(4))


def _over_ground(path: PlannedPath, clearance: Clearance, *, is_level: bool) -> GroundCurve:
    """The path over uneven ground."""
    count = max(round(path.length_m / GROUND_STEP_M), 4)
    stops_m = np.linspace(0.0, path.length_m, count + 1)
    heights_m = clearance.ground_at(path.points_m(stops_m))
    return over_ground(path.curve, stops_m, heights_m, is_level=is_level)


def _carried(walk: Motion, floor_m: float, rng: np.random.Generator) -> Motion:
    """A camera that a person who walks carries in both hands."""
    height_m = floor_m + rng.uniform(*HAND_HEIGHT_M)
    hold = Pose(t_s=0.0, position_m=(0.0, 0.0, 0.0), pitch_deg=rng.uniform(*HAND_PITCH_DEG))
    held = Placed(walk, height_m, hold.T_world_body)
    return HandheldMotion(held, draw_shake(SHAKES["walking"], rng))


def _flown(path: PlannedPath, habits: BodyHabits, clearance: Clearance, rng: np.random.Generator) -> Motion:
    """A flight near a path, at heights that are drawn."""
    count = max(round(path.length_m / FLIGHT_POINT_M), 1) + 1
    ground_points_m = path.points_m(np.linspace(0.0, path.length_m, count))
    heights_m = clearance.ground_at(ground_points_m) + rng.uniform(*FLIGHT_HEIGHT_M, count)
    points_m = np.column_stack([ground_points_m, heights_m])
    speed_mps = rng.uniform(*habits.speed_mps)
    flight = Quadrotor(points_m=tuple((x, y, z) for x, y, z in points_m.tolist()), speed_mps=speed_mps)
    return flight.motion()


def _law(path: PlannedPath, habits: BodyHabits, rng: np.random.Generator) -> TimeLaw:
    """When the body is where on a path: from rest to rest, at speeds that change, with stops."""
    lengths_m = np.array([piece.length for piece in path.pieces])
    ends_m = np.concatenate([[0.0], np.cumsum(lengths_m)])
    bends = np.abs([piece.bend for piece in path.pieces] + [path.pieces[-1].bend])

    # The nodes at which speeds are drawn are ends of some of the pieces.
    nodes = [0]
    while nodes[-1] < len(lengths_m):
        nodes.append(min(nodes[-1] + int(rng.integers(LEVEL_STEPS, 2 * LEVEL_STEPS + 1)), len(lengths_m)))
    if len(nodes) > 2 and nodes[-1] - nodes[-2] < LEVEL_STEPS:
        del nodes[-2]
    if len(nodes) == 2:
        nodes.insert(1, len(lengths_m) // 2)
    return _law_through(np.array(nodes), ends_m, bends, habits, rng)


def _law_through(
    nodes: NDArray[np.intp], ends_m: Array, bends: Array, habits: BodyHabits, rng: np.random.Generator
) -> TimeLaw:
    """The law of speeds that are drawn at nodes, which are numbers of ends (N,) of pieces with curvatures (N,)."""
    slow_mps, fast_mps = habits.speed_mps
    speeds_mps = rng.uniform(slow_mps, fast_mps, len(nodes))
    pauses_s = np.zeros(len(nodes))
    stretches_m = np.diff(ends_m[nodes])
    speeds_mps[[0, -1]] = 0.0
    for k in range(2, len(nodes) - 2):
        is_stop = habits.stop_every_m > 0 and rng.random() < stretches_m[k - 1] / habits.stop_every_m
        if is_stop and speeds_mps[k - 1] > 0:
            speeds_mps[k] = 0.0
            pauses_s[k] = rng.uniform(*habits.stop_s)

    for k in range(len(nodes)):
        first = nodes[max(k - 1, 0)]
        last = nodes[min(k + 1, len(nodes) - 1)]
        sharpest = max(float(bends[first : last + 1].max()), 1e-9)
        in_bend_mps = min(np.sqrt(habits.lateral_mps2 / sharpest), habits.yaw_radps / sharpest)
        speeds_mps[k] = min(speeds_mps[k], in_bend_mps)

    # The acceleration over a stretch is at most 15/16 |v1² - v0²| / length.
    gains = 16 / 15 * habits.accel_mps2 * stretches_m
    for k in range(len(stretches_m)):
        speeds_mps[k + 1] = min(speeds_mps[k + 1], np.sqrt(speeds_mps[k] ** 2 + gains[k]))
    for k in reversed(range(len(stretches_m))):
        speeds_mps[k] = min(speeds_mps[k], np.sqrt(speeds_mps[k + 1] ** 2 + gains[k]))
    return through_speeds(stretches_m, speeds_mps, pauses_s)
