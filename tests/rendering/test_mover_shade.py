"""Movers shade and are lit as the same things at rest, whatever was drawn before and wherever pictures look."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy
from OpenGL import GL

from tests.rendering.test_illumination import BULB, CRATE, DIRECT, PANEL, PLACES, ROOM, layer, ns, scene, window_room
from tests.rendering.test_mover_light import CAMERA
from vobench.geometry import se3
from vobench.geometry.rig import looking
from vobench.rendering.bake import bake
from vobench.rendering.baked_scene import BakedScene, BakeSettings
from vobench.rendering.context import create_context
from vobench.rendering.illumination import Illumination
from vobench.rendering.mover_shade import ShadedLight, Views
from vobench.rendering.view import pinhole_view
from vobench.scene.light import Light, Sky, Sun
from vobench.scene.mesh import moved
from vobench.scene.scene import Mover, WaypointMotion

FINE = replace(DIRECT, spacing_m=0.05)
COARSE = BakeSettings(spacing_m=0.1, light_rays=16, indirect_spacing_m=0.3, indirect_rays=64, bounces=3)
DAY = Sky("sky", 5_000.0, "uniform")
SUN = Sun("sun", 1e4, (0.0,), (90.0,), (40.0,))
Lit = Callable[..., np.ndarray]


def walk(*positions_m: tuple[float, float, float]) -> Mover:
    times = np.arange(len(positions_m), dtype=float)
    return Mover("crate", (CRATE,), WaypointMotion(times, np.array(positions_m), np.zeros(len(positions_m))))


def views(baked: BakedScene, t_ns: float, yaws_deg: Sequence[float] = range(0, 360, 30)) -> Views:
    """Wide views from the middle of the room, of all of it by default."""
    poses = [mover.path.pose(t_ns) for mover in baked.scene.movers]
    result = []
    for yaw_deg in yaws_deg:
        for pitch_deg in (-80, 0, 80) if len(yaws_deg) > 2 else (0,):
            T_turned = se3.transform(se3.rotation_z(np.deg2rad(yaw_deg)), np.zeros(3))
            T = T_turned @ looking(pitch_deg=pitch_deg, position_m=(0, 0, 1.2))
            view = pinhole_view(CAMERA, T, poses, np.zeros((0, 4, 4)), ambient_cd_m2=np.ones(3))
            result.append((view, (0, CAMERA.width_px, 0, CAMERA.height_px)))
    return result


class Drawn:
    """The map of light of a baked scene as it is drawn, and the same without movers."""

    def __init__(self, baked: BakedScene) -> None:
        self._baked = baked
        self._illumination = Illumination(baked)
        self._light = ShadedLight(baked, self._illumination.at(0, 0))

    def at(self, t_ns: int, yaws_deg: Sequence[float] = range(0, 360, 30)) -> np.ndarray:
        colours, suns_ns = self._illumination.lights_at(t_ns, t_ns)
        values = self.empty(t_ns)
        self._light.shade(values, t_ns, suns_ns, colours, views(self._baked, t_ns, yaws_deg))
        GL.glBindTexture(GL.GL_TEXTURE_2D, self._light.id)
        buffer = GL.glGetTexImage(GL.GL_TEXTURE_2D, 0, GL.GL_RGB, GL.GL_FLOAT)
        return np.frombuffer(buffer, np.float32).reshape(values.shape)

    def empty(self, t_ns: int = 0) -> np.ndarray:
        return self._illumination.at(t_ns, t_ns)


@pytest.fixture(scope="module")
def drawn() -> Iterator[Callable[[BakedScene], Drawn]]:
    context = create_context()
    for capability in (GL.GL_SCISSOR_TEST, GL.GL_DEPTH_TEST, GL.GL_CULL_FACE):
        GL.glEnable(capability)
    GL.glClipControl(GL.GL_LOWER_LEFT, GL.GL_ZERO_TO_ONE)
    GL.glDepthFunc(GL.GL_GEQUAL)
    GL.glClearDepth(0.0)

    def create(baked: BakedScene) -> Drawn:
        context.make_current()
        return Drawn(baked)

    yield create
    context.release()


def on(baked: BakedScene, light: np.ndarray, name: str) -> np.ndarray:
    """Light (N,) at places all over the faces of one thing."""
    faces, (height, width) = baked.faces, light.shape[:2]
    own = [faces.things[thing].name == name for thing in faces.thing]
    u, v = np.moveaxis(PLACES @ baked.light_uv[own].astype(float), -1, 0).reshape(2, -1)
    return scipy.ndimage.map_coordinates(light[..., 1], [v * height - 0.5, u * width - 0.5], order=1, mode="nearest")


@pytest.mark.parametrize("light", [PANEL, BULB, DAY, SUN], ids=["panel", "bulb", "sky", "sun"])
def test_a_mover_shades_and_is_lit_as_the_same_thing_at_rest(drawn: Any, light: Light) -> None:
    """Within 3 % of the mean on the room, 6 % by the sky's few samples; 12 % on each of the mover's sides."""
    place = np.array([-0.5, -0.3, 0.2])
    things = window_room() if light in (DAY, SUN) else ROOM
    moving = bake(scene(light, things=things, movers=(walk(tuple(place)),)), FINE)
    lit = drawn(moving).at(0)
    crate = replace(CRATE, mesh=moved(CRATE.mesh, se3.transform(np.eye(3), place)))
    rest = bake(scene(light, things=(*things, crate)), FINE)
    straight = layer(rest, 0)
    empty = Illumination(moving).at(0, 0)
    for name in ("floor", "west", "south"):
        ours, theirs = on(moving, lit, name), on(rest, straight, name)
        if theirs.mean() > 1e-3 * straight.max():
            assert np.abs(ours - theirs).mean() < (0.06 if light is DAY else 0.03) * theirs.mean()
    shade = on(moving, empty, "floor") - on(rest, straight, "floor")
    taken = on(moving, empty, "floor") - on(moving, lit, "floor")
    assert taken.sum() == pytest.approx(shade.sum(), rel=0.1)
    ours, theirs = on(moving, lit, "crate").reshape(6, -1).mean(1), on(rest, straight, "crate").reshape(6, -1).mean(1)
    np.testing.assert_allclose(ours, theirs, rtol=0.12, atol=0.01 * theirs.max())


def test_a_mover_takes_indirect_light_from_the_room(drawn: Any) -> None:
    baked = bake(scene(PANEL, movers=(walk((0.5, 0.3, 0.0)),)), COARSE)
    lit = drawn(baked).at(0)
    room_around = np.mean([on(baked, lit, thing.name).mean() for thing in ROOM])
    darkest = on(baked, lit, "crate").reshape(12, -1).mean(1)
    assert 0.1 * room_around < np.sort(darkest)[2] < 2 * room_around  # the two faces below see the floor alone
    direct = replace(baked, bounced=0 * baked.bounced, settings=DIRECT)
    assert on(direct, drawn(direct).at(0), "crate").min() == 0


def test_where_a_mover_was_before_leaves_nothing_behind(drawn: Any) -> None:
    things = window_room()
    baked = bake(scene(PANEL, BULB, DAY, things=things, movers=(walk((0, 0, 0), (1, 0.5, 0)),)), DIRECT)
    light = drawn(baked)
    first, *_, last = (light.at(ns(t_s)) for t_s in (0, 0.1, 0.3, 0.9))
    assert not np.array_equal(first, last)
    assert last.tobytes() == drawn(baked).at(ns(0.9)).tobytes()


def test_shade_drawn_view_by_view_is_that_drawn_at_once(drawn: Any) -> None:
    baked = bake(scene(PANEL, BULB, movers=(walk((0, 0, 0)),)), DIRECT)
    light = drawn(baked)
    ahead = light.at(0, (0,))
    light.at(0, (90,))
    assert light.at(0).tobytes() == drawn(baked).at(0).tobytes()
    assert ahead.tobytes() != light.at(0).tobytes()


def test_a_mover_of_glass_takes_no_light(drawn: Any) -> None:
    pane = replace(walk((0.5, 0.3, 0)), things=(replace(CRATE, material="pane"),))
    baked = bake(scene(PANEL, movers=(pane,)), DIRECT)
    np.testing.assert_array_equal(drawn(baked).at(0), drawn(baked).empty())


def test_a_mover_only_takes_light(drawn: Any) -> None:
    baked = bake(scene(PANEL, BULB, DAY, things=window_room(), movers=(walk((0, 0, 0)),)), COARSE)
    light = drawn(baked)
    lit, empty = light.at(0), light.empty()
    for thing in ROOM:
        assert (on(baked, lit, thing.name) <= on(baked, empty, thing.name) * (1 + 1e-5)).all()
    assert lit.min() >= 0
    assert on(baked, lit, "floor").sum() < on(baked, empty, "floor").sum()
