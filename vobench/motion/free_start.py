"""Draws the start of a path of given shape or through poses, such that the robot on it keeps clear of everything."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from math import cos, degrees, radians, sin

import numpy as np

from vobench.errors import MotionError
from vobench.geometry.se3 import Array
from vobench.motion.course import Circle, Planar
from vobench.motion.spline import PoseSpline
from vobench.motion.wander import CAR, HABITS, BodyHabits, Clearance, body_clearance_m, planar_poses
from vobench.setting import Triple

STARTS = 2000  # that are tried
PATH_POSES = 200  # of a path, at which it is checked
LEVEL_M = 0.01  # wheels drive at z = 0, so a floor has to be this close to it

Startable = Planar | PoseSpline  # the paths that may have a start_seed


@dataclass(frozen=True, slots=True)
class Start:
    """A position on the floor and a heading, as of the start of a path."""

    x_m: float
    y_m: float
    heading_deg: float

    @property
    def position_m(self) -> Array:
        """The position (2,)."""
        return np.array([self.x_m, self.y_m])


@dataclass(frozen=True, slots=True)
class Relocation:
    """The motion on the floor that takes one start to another, and everything around it along."""

    old: Start
    new: Start

    @property
    def turn_deg(self) -> float:
        """The angle by which everything is turned to the left."""
        return self.new.heading_deg - self.old.heading_deg

    def position_m(self, position_m: Triple) -> Triple:
        """Where a position is taken to. Its height does not change."""
        x_m, y_m = self.points_m(np.array(position_m[:2])).tolist()
        return x_m, y_m, position_m[2]

    def points_m(self, points_m: Array) -> Array:
        """Where points (..., 2) of the floor are taken to."""
        cosine = cos(radians(self.turn_deg))
        sine = sin(radians(self.turn_deg))
        R = np.array([[cosine, -sine], [sine, cosine]])
        moved: Array = (points_m - self.old.position_m) @ R.T + self.new.position_m
        return moved


@dataclass(frozen=True, slots=True)
class FloorUse:
    """What things around a path need of the floor: points (N, 2) in m, and what has to be free around each (N,)."""

    points_m: Array
    radius_m: Array


NO_FLOOR_USE = FloorUse(np.zeros((0, 2)), np.zeros(0))


def joined_floor_use(uses: Iterable[FloorUse]) -> FloorUse:
    """What all of several need."""
    parts = [NO_FLOOR_USE, *uses]
    points_m = np.concatenate([part.points_m for part in parts])
    radius_m = np.concatenate([part.radius_m for part in parts])
    return FloorUse(points_m, radius_m)


def habits_of(spec: Startable) -> BodyHabits:
    """The space that the robot of a path takes; through poses, that of a Pioneer."""
    is_car = not isinstance(spec, PoseSpline) and spec.mover == "ackermann" and spec.car == CAR
    return HABITS["car" if is_car else "pioneer"]


def start_of(spec: Startable) -> Start:
    """The start of a path."""
    if isinstance(spec, PoseSpline):
        first = spec.poses[0]
        return Start(first.position_m[0], first.position_m[1], first.yaw_deg)
    return Start(*spec.start_m, spec.start_heading_deg)


def from_free_start(spec: Startable, clearance: Clearance, floor_use: FloorUse = NO_FLOOR_USE) -> Startable:
    """The path from the first start, of those that its `start_seed` draws, on which the robot keeps clear.

    The position is uniform over the free floor, and the heading over all directions. The path is that of an ideal
    robot; a Pioneer deviates from it by less than the margin that is kept. The `floor_use` of things around the path,
    where that starts as given, is free, too.

    Raises MotionError if the floor is uneven or not at z = 0, or if no start is found.
    """
    if clearance.ground_m is not None or abs(clearance.floor_m) > LEVEL_M:
        raise MotionError("start_seed is for places with a level floor at z = 0")
    habits = habits_of(spec)
    needed_m = habits.radius_m + habits.margin_m
    free_cells = np.flatnonzero(clearance.distance_m >= needed_m)
    local_poses = _poses_from_origin(spec)

    rng = np.random.default_rng(spec.start_seed)
    for _ in range(STARTS if len(free_cells) else 0):
        x_m, y_m = clearance.centre(int(rng.choice(free_cells))).tolist()
        heading_rad = rng.uniform(-np.pi, np.pi)
        poses = _moved(local_poses, x_m, y_m, heading_rad)
        if body_clearance_m(clearance, poses, habits).min() < needed_m:
            continue
        start = Start(x_m, y_m, degrees(heading_rad))
        around_m = Relocation(start_of(spec), start).points_m(floor_use.points_m)
        if (clearance.at(around_m) >= floor_use.radius_m).all():
            return started(spec, start)
    raise MotionError(
        f"no start was found from which a {spec.kind} keeps {needed_m:.2g} m clear of everything; choose a smaller "
        "one or a larger place"
    )


def started(spec: Startable, start: Start) -> Startable:
    """The path from a given start. Poses keep their heights."""
    if not isinstance(spec, PoseSpline):
        return replace(spec, start_m=(start.x_m, start.y_m), start_heading_deg=start.heading_deg, start_seed=None)
    move = Relocation(start_of(spec), start)
    poses = []
    for pose in spec.poses:
        position_m = move.position_m(pose.position_m)
        poses.append(replace(pose, position_m=position_m, yaw_deg=pose.yaw_deg + move.turn_deg))
    return replace(spec, poses=tuple(poses), start_seed=None)


def _poses_from_origin(spec: Startable) -> Array:
    """The poses (PATH_POSES, 3) of a robot on the path from the origin, as x and y in m and heading in rad.

    A circle is checked once around, so that the start does not depend on the number of laps.
    """
    at_origin = started(spec, Start(0.0, 0.0, 0.0))
    if isinstance(at_origin, PoseSpline):
        return planar_poses(at_origin.motion(), PATH_POSES)
    if isinstance(at_origin, Circle):
        at_origin = replace(at_origin, laps=1.0)
    return planar_poses(at_origin.way(), PATH_POSES)


def _moved(poses: Array, x_m: float, y_m: float, heading_rad: float) -> Array:
    """Poses (N, 3) in the frame of a start, in the frame of the place."""
    cosine = np.cos(heading_rad)
    sine = np.sin(heading_rad)
    moved_x_m = x_m + cosine * poses[:, 0] - sine * poses[:, 1]
    moved_y_m = y_m + sine * poses[:, 0] + cosine * poses[:, 1]
    return np.stack([moved_x_m, moved_y_m, poses[:, 2] + heading_rad], -1)
