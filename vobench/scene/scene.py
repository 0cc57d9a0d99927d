"""A scene: things with materials, lights, and movers; metres, world frame, z up."""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.scene.fog import Fog
from vobench.scene.light import AreaLight, Light, PointLight, SpotLight
from vobench.scene.material import Material
from vobench.scene.mesh import moved, quad
from vobench.scene.rain import Rain
from vobench.scene.triangles import Thing, Triangles, triangle_table
from vobench.scene.wind import Wind
from vobench.trajectory.nanoseconds import NS_PER_S


class MoverMotion(Protocol):
    """The trajectory of a rigid thing."""

    def pose(self, t_ns: float) -> Array:
        """T_world_mover (4, 4) at an instant."""

    def sized(self, by: float) -> "MoverMotion":
        """The same with all lengths times `by`."""


@dataclass(frozen=True, slots=True)
class WaypointMotion:
    """A trajectory linear between positions_m (K, 3) and yaw_deg (K,) at increasing times_s (K,).

    Before the first and after the last time the mover rests, or starts again where `repeats`.
    """

    times_s: Array
    positions_m: Array
    yaw_deg: Array
    repeats: bool = False

    def pose(self, t_ns: float) -> Array:
        """T_world_mover (4, 4) at an instant."""
        t_s = t_ns / NS_PER_S
        start_s = self.times_s[0]
        if self.repeats:
            t_s = start_s + (t_s - start_s) % (self.times_s[-1] - start_s)
        position = [np.interp(t_s, self.times_s, axis) for axis in self.positions_m.T]
        yaw = np.deg2rad(np.interp(t_s, self.times_s, self.yaw_deg))
        return se3.transform(se3.rotation_z(yaw), np.array(position))

    def distance_m(self, t_ns: float) -> float:
        """The distance travelled from the first time to an instant."""
        t_s = t_ns / NS_PER_S
        steps_m = np.linalg.norm(np.diff(self.positions_m, axis=0), axis=1)
        distance_m = np.append(0, np.cumsum(steps_m))
        duration_s = self.times_s[-1] - self.times_s[0]
        rounds = 0.0
        if self.repeats:
            rounds = np.floor((t_s - self.times_s[0]) / duration_s)
        within_round = np.interp(t_s - rounds * duration_s, self.times_s, distance_m)
        return float(rounds * distance_m[-1] + within_round)

    def sized(self, by: float) -> "WaypointMotion":
        """The same with all lengths times `by`."""
        return replace(self, positions_m=self.positions_m * by)


def jointed(joints_m: Array, pitch_rad: Array) -> Array:
    """T_body_limb (4, 4) of a limb rotated about y at joints (J, 3), which are given unrotated, from the body on."""
    T = np.eye(4)
    for joint_m, pitch in zip(joints_m, pitch_rad, strict=True):
        c = np.cos(pitch)
        s = np.sin(pitch)
        R = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        T = T @ se3.transform(R, joint_m - R @ joint_m)
    return T


def _periodic(phase: float, steps: Array, values: Array) -> float:
    """A value at a phase in [0, 1) of a cycle, linear between values (K,) at its K even steps."""
    return float(np.interp(phase, steps, [*values, values[0]]))


@dataclass(frozen=True, slots=True)
class LimbMotion:
    """The trajectory of a limb of somebody who walks a path: it swings with the distance travelled.

    joints_m (J, 3) as in `jointed`; pitch_rad (K, J) and rise_m (K,), how high the body is, at K even steps of a
    cycle of cycle_m.
    """

    path: WaypointMotion
    cycle_m: float
    joints_m: Array
    pitch_rad: Array
    rise_m: Array

    def pose(self, t_ns: float) -> Array:
        """T_world_limb (4, 4) at an instant."""
        phase = self.path.distance_m(t_ns) / self.cycle_m % 1
        steps = np.linspace(0, 1, len(self.rise_m) + 1)
        rise = _periodic(phase, steps, self.rise_m)
        pitch = [_periodic(phase, steps, joint) for joint in self.pitch_rad.T]
        T_ground_body = se3.transform(np.eye(3), [0, 0, rise])
        return self.path.pose(t_ns) @ T_ground_body @ jointed(self.joints_m, np.array(pitch))

    def sized(self, by: float) -> "LimbMotion":
        """The same with all lengths times `by`."""
        return LimbMotion(self.path.sized(by), self.cycle_m * by, self.joints_m * by, self.pitch_rad, self.rise_m * by)


@dataclass(frozen=True, slots=True)
class Mover:
    """A rigid body that moves; its things are in its own frame. A body with limbs is several movers of one name."""

    name: str
    things: tuple[Thing, ...]
    path: MoverMotion


@dataclass(frozen=True, slots=True)
class Scene:
    """Stationary things, their materials by name, the lights that shine on them, movers, fog, rain and wind."""

    name: str
    things: tuple[Thing, ...]
    materials: dict[str, Material]
    lights: tuple[Light, ...]
    movers: tuple[Mover, ...] = ()
    fog: Fog | None = None
    rain: Rain | None = None
    wind: Wind | None = None

    @property
    def panels(self) -> tuple[AreaLight, ...]:
        """The lights that can be seen."""
        return tuple(light for light in self.lights if isinstance(light, AreaLight))


def triangles(
    scene: Scene,
    *,
    t_ns: float | None = None,
) -> Triangles:
    """Every face of a scene: things, panels, movers; these in their own frames where t_ns is None."""
    things = list(scene.things)
    mover = [-1] * len(things)
    lamp = [-1] * len(things)
    for nth, light in enumerate(scene.lights):
        if isinstance(light, AreaLight):
            things.append(Thing(light.name, light.mesh, light.material or light.name))
            mover.append(-1)
            lamp.append(nth)
    for nth, body in enumerate(scene.movers):
        things += body.things
        mover += [nth] * len(body.things)
        lamp += [-1] * len(body.things)

    faces = triangle_table(things, mover, lamp)
    return faces if t_ns is None else faces.with_movers_at([body.path.pose(t_ns) for body in scene.movers])


def ceiling_light(
    name: str,
    center_m: Array,
    size_m: tuple[float, float],
    *,
    power_lm: float,
) -> AreaLight:
    """A panel that hangs level and shines down."""
    x = np.array([size_m[0], 0, 0])
    y = np.array([0, size_m[1], 0])
    corner = np.asarray(center_m, float) - (x + y) / 2
    return AreaLight(name, quad(corner, y, x), power_lm)


def sized(scene: Scene, by: float) -> Scene:
    """The scene with all lengths times `by`, textures too; lamps are so much stronger that it is lit as before."""
    movers = []
    for mover in scene.movers:
        things = tuple(_sized_thing(thing, by) for thing in mover.things)
        movers.append(replace(mover, things=things, path=mover.path.sized(by)))
    return replace(
        scene,
        things=tuple(_sized_thing(thing, by) for thing in scene.things),
        lights=tuple(_sized_light(light, by) for light in scene.lights),
        movers=tuple(movers),
        fog=scene.fog and replace(scene.fog, visibility_m=scene.fog.visibility_m * by),
    )


def _sized_thing(thing: Thing, by: float) -> Thing:
    spacing_m = thing.spacing_m and thing.spacing_m * by
    return replace(thing, mesh=moved(thing.mesh, _scaling(by)), spacing_m=spacing_m)


def _sized_light(light: Light, by: float) -> Light:
    """A light whose power grows with the areas that it shines on."""
    if isinstance(light, AreaLight):
        return replace(light, mesh=moved(light.mesh, _scaling(by)), power_lm=light.power_lm * by**2)
    if isinstance(light, PointLight | SpotLight):
        return replace(light, position_m=light.position_m * by, power_lm=light.power_lm * by**2)
    return light


def _scaling(by: float) -> Array:
    return np.diag([by, by, by, 1.0])
