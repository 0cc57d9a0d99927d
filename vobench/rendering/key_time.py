"""The instants for which the light of lamps is baked: one, or several along the path of a moving sun."""

from itertools import pairwise

import numpy as np

from vobench.geometry.se3 import Array
from vobench.scene.light import Light, Sun
from vobench.scene.scene import Scene
from vobench.trajectory.nanoseconds import NS_PER_S

SUN_STEP_RAD = np.deg2rad(3)  # the largest angle between successive instants of a moving sun


def moving_suns(scene: Scene) -> tuple[int, ...]:
    """The indices of the lights that are moving suns."""
    indices = [index for index, light in enumerate(scene.lights) if light.moves]
    return tuple(indices)


def key_times_ns(light: Light) -> tuple[float, ...]:
    """The instants in ns for which a light is baked: one, or several along the path of a moving sun."""
    if not isinstance(light, Sun):
        return (0.0,)
    if not light.moves:
        return (light.times_s[0] * NS_PER_S,)
    times_ns = np.array(light.times_s) * NS_PER_S
    angles_rad = np.diff(travelled_rad(light))  # between successive times
    needed_steps = np.ceil(angles_rad / SUN_STEP_RAD)
    step_counts = np.maximum(needed_steps, 1).astype(int)
    inner_ns = []
    for (start_ns, end_ns), count in zip(pairwise(times_ns), step_counts, strict=True):
        inner_ns.append(np.linspace(start_ns, end_ns, count, endpoint=False))
    return (*np.concatenate(inner_ns).tolist(), float(times_ns[-1]))


def travelled_rad(sun: Sun) -> Array:
    """An upper bound (K,) in rad on the angle that a sun has travelled from its first time to each of its K times."""
    azimuth_rad = np.deg2rad(sun.azimuth_deg)
    elevation_rad = np.deg2rad(sun.elevation_deg)
    from_horizon_rad = np.abs(elevation_rad)
    lower_rad = np.minimum(from_horizon_rad[1:], from_horizon_rad[:-1])
    # An upper bound on the horizontal angle: for a given change of azimuth, it is largest at the lower elevation.
    horizontal_rad = np.diff(azimuth_rad) * np.cos(lower_rad)
    vertical_rad = np.diff(elevation_rad)
    steps_rad = np.hypot(horizontal_rad, vertical_rad)
    return np.concatenate([[0.0], np.cumsum(steps_rad)])
