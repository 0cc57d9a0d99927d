"""A scene: things with materials, lights, and movers; metres, world frame, z up."""

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from vobench.geometry import se3
from vobench.geometry.se3 import Array
from vobench.scene.light import AreaLight, Light, PointLight, SpotLight
from vobench.scene.material import Material
from vobench.scene.mesh import Thing, Triangles, quad, table


class Way(Protocol):
    """Where a rigid thing is at any time."""

    def pose(self, t_ns: float) -> Array:
        """T_world_mover (4, 4) at an instant."""

    def sized(self, by: float) -> "Way":
        """The same with all lengths times `by`."""


@dataclass(frozen=True, slots=True)
class Path:
    """Straight ways between positions_m (K, 3) and yaw_deg (K,) at increasing times_s (K,), even in time.

    Before the first and after the last time the mover rests, or starts again where `repeats`.
    """

    times_s: Array
    positions_m: Array
    yaw_deg: Array
    repeats: bool = False

    def pose(self, t_ns: float) -> Array:
        """T_world_mover (4, 4) at an instant."""
        t_s = t_ns / 1e9
        if self.repeats:
            t_s = self.times_s[0] + (t_s - self.times_s[0]) % (self.times_s[-1] - self.times_s[0])
        position = [np.interp(t_s, self.times_s, axis) for axis in self.positions_m.T]
        yaw = np.deg2rad(np.interp(t_s, self.times_s, self.yaw_deg))
        return se3.transform(se3.rotation_z(yaw), np.array(position))

    def distance_m(self, t_ns: float) -> float:
        """The length of the way from the first time to an instant."""
        gone_m = np.append(0, np.cumsum(np.linalg.norm(np.diff(self.positions_m, axis=0), axis=1)))
        rounds = 0.0
        lasts_s = self.times_s[-1] - self.times_s[0]
        if self.repeats:
            rounds = np.floor((t_ns / 1e9 - self.times_s[0]) / lasts_s)
        return float(rounds * gone_m[-1] + np.interp(t_ns / 1e9 - rounds * lasts_s, self.times_s, gone_m))

    def sized(self, by: float) -> "Path":
        """The same with all lengths times `by`."""
        return replace(self, positions_m=self.positions_m * by)


def jointed(joints_m: Array, pitch_rad: Array) -> Array:
    """T_body_limb (4, 4) of a limb turned about y at joints (J, 3), given as they are unturned, from the body on."""
    T = np.eye(4)
    for joint_m, turn in zip(joints_m, pitch_rad, strict=True):
        c = np.cos(turn)
        s = np.sin(turn)
        R = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        T = T @ se3.transform(R, joint_m - R @ joint_m)
    return T


@dataclass(frozen=True, slots=True)
class Gait:
    """The way of a limb of somebody who walks a path: it swings with the distance, and stands still when they do.

    joints_m (J, 3) as in `jointed`; pitch_rad (K, J) and rise_m (K,), how high the body is, at K even steps of a
    cycle of cycle_m.
    """

    path: Path
    cycle_m: float
    joints_m: Array
    pitch_rad: Array
    rise_m: Array

    def pose(self, t_ns: float) -> Array:
        """T_world_limb (4, 4) at an instant."""
        phase = self.path.distance_m(t_ns) / self.cycle_m % 1
        steps = np.linspace(0, 1, len(self.rise_m) + 1)
        rise, *pitch = (np.interp(phase, steps, [*x, x[0]]) for x in (self.rise_m, *self.pitch_rad.T))
        up = se3.transform(np.eye(3), [0, 0, rise])
        return self.path.pose(t_ns) @ up @ jointed(self.joints_m, np.array(pitch))

    def sized(self, by: float) -> "Gait":
        """The same with all lengths times `by`."""
        return Gait(self.path.sized(by), self.cycle_m * by, self.joints_m * by, self.pitch_rad, self.rise_m * by)


@dataclass(frozen=True, slots=True)
class Mover:
    """A rigid thing on its way; its things are in its own frame. What has limbs is several movers of one name."""

    name: str
    things: tuple[Thing, ...]
    path: Way


@dataclass(frozen=True, slots=True)
class Scene:
    """Things that stand still, their materials by name, the lights that shine on them, and movers."""

    name: str
    things: tuple[Thing, ...]
    materials: dict[str, Material]
    lights: tuple[Light, ...]
    movers: tuple[Mover, ...] = ()

    @property
    def panels(self) -> tuple[AreaLight, ...]:
        """The lights that can be seen."""
        return tuple(light for light in self.lights if isinstance(light, AreaLight))


def triangles(scene: Scene, *, t_ns: float | None = None) -> Triangles:
    """Every face of a scene: things, panels, movers; these in their own frames where t_ns is None."""
    lamps = {nth: light for nth, light in enumerate(scene.lights) if isinstance(light, AreaLight)}
    panels = {nth: Thing(light.name, light.mesh, light.material or light.name) for nth, light in lamps.items()}
    moving = [(nth, thing) for nth, m in enumerate(scene.movers) for thing in m.things]
    things = [*scene.things, *panels.values(), *(thing for _, thing in moving)]
    mover = [-1] * (len(scene.things) + len(panels)) + [nth for nth, _ in moving]
    lamp = [-1] * len(scene.things) + list(panels) + [-1] * len(moving)
    faces = table(things, mover, lamp)
    return faces if t_ns is None else faces.moved([m.path.pose(t_ns) for m in scene.movers])


def ceiling_light(name: str, center_m: Array, size_m: tuple[float, float], *, power_lm: float) -> AreaLight:
    """A panel that hangs level and shines down."""
    x = np.array([size_m[0], 0, 0])
    y = np.array([0, size_m[1], 0])
    return AreaLight(name, quad(np.asarray(center_m, float) - (x + y) / 2, y, x), power_lm)


def sized(scene: Scene, by: float) -> Scene:
    """The scene with all lengths times `by`, textures too; lamps are so much stronger that it is lit as before."""
    T = np.diag([by, by, by, 1.0])

    def grown(things: tuple[Thing, ...]) -> tuple[Thing, ...]:
        return tuple(
            replace(thing, mesh=thing.mesh.moved(T), spacing_m=thing.spacing_m and thing.spacing_m * by)
            for thing in things
        )

    def brighter(light: Light) -> Light:
        if isinstance(light, AreaLight):
            return replace(light, mesh=light.mesh.moved(T), power_lm=light.power_lm * by**2)
        if isinstance(light, PointLight | SpotLight):
            return replace(light, position_m=light.position_m * by, power_lm=light.power_lm * by**2)
        return light

    movers = [replace(m, things=grown(m.things), path=m.path.sized(by)) for m in scene.movers]
    lights = tuple(map(brighter, scene.lights))
    return replace(scene, things=grown(scene.things), lights=lights, movers=tuple(movers))
