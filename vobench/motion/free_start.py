"""Draws the start of a path of given shape, so that the robot on it keeps clear of everything in its place."""

from dataclasses import replace
from math import degrees

import numpy as np

from vobench.errors import MotionError
from vobench.geometry.se3 import Array
from vobench.motion.course import Circle, Planar
from vobench.motion.wander import CAR, HABITS, BodyHabits, Clearance, body_clearance_m, planar_poses

STARTS = 2000  # that are tried
PATH_POSES = 200  # of a path, at which it is checked
LEVEL_M = 0.01  # wheels drive at z = 0, so a floor has to be this close to it


def habits_of(spec: Planar) -> BodyHabits:
    """The space that the robot of a path takes."""
    is_car = spec.mover == "ackermann" and spec.car == CAR
    return HABITS["car" if is_car else "pioneer"]


def from_free_start(spec: Planar, clearance: Clearance) -> Planar:
    """The path from the first start, of those that its `start_seed` draws, on which the robot keeps clear.

    The position is uniform over the free floor, and the heading over all directions. The path is that of an ideal
    robot; a Pioneer deviates from it by less than the margin that is kept.

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
        if body_clearance_m(clearance, poses, habits).min() >= needed_m:
            return replace(spec, start_m=(x_m, y_m), start_heading_deg=degrees(heading_rad), start_seed=None)
    raise MotionError(
        f"no start was found from which a {spec.kind} keeps {needed_m:.2g} m clear of everything; choose a smaller "
        "one or a larger place"
    )


def _poses_from_origin(spec: Planar) -> Array:
    """The poses (PATH_POSES, 3) of a robot on the path from the origin, as x and y in m and heading in rad.

    A circle is checked once around, so that the start does not depend on the number of laps.
    """
    at_origin = replace(spec, start_m=(0.0, 0.0), start_heading_deg=0.0)
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
