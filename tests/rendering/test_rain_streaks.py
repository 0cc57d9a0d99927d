"""Drops of rain in pictures: the length, width and cover of their streaks, and what hides them."""

from typing import Any

import numpy as np
import pytest

from vobench.geometry.camera import Camera, KannalaBrandt, Pinhole
from vobench.geometry.rig import looking
from vobench.geometry.se3 import Array
from vobench.rendering.rain_streaks import RainStreaks
from vobench.rendering.renderer import View
from vobench.scene.light import Sky
from vobench.scene.material import LUMINANCE, Material
from vobench.scene.mesh import quad
from vobench.scene.rain import NearDrops, Rain
from vobench.scene.scene import Scene
from vobench.scene.triangles import Thing
from vobench.sensor.lens_drops import APERTURE_M

CAMERA = Pinhole(180, 120, 150.0, 150.0, 89.5, 59.5)
FISHEYE = KannalaBrandt(180, 120, 60.0, 60.0, 89.5, 59.5, 0.0, 0.0, 0.0, 0.0)
AHEAD = looking(pitch_deg=0, position_m=(0.0, 0.0, 1.0))  # along x
MS_NS = 1_000_000
MATERIALS = {"grey": Material(colour=(0.2, 0.2, 0.2)), "glass": Material("pane", eta=1.5)}
SKY = Sky("sky", 1000.0)
RAIN = Rain(rate_mm_per_h=30.0)


class OneDrop:
    """Stands for the falling drops: one at a place at time 0."""

    def __init__(self, position_m: Any, *, fall_mps: float = 0.0, diameter_m: float = 2e-3) -> None:
        self.position_m = np.array([position_m], float)
        self.velocity_mps = np.array([[0.0, 0.0, -fall_mps]])
        self.diameter_m = np.array([diameter_m])

    def near(self, camera_m: Array, t_ns: float) -> NearDrops:
        position_m = self.position_m + self.velocity_mps * t_ns / 1e9
        return NearDrops(position_m, self.velocity_mps, self.diameter_m, t_ns)


def exposure(exposure_ms: float, camera: Camera = CAMERA, sub_frames: int = 1, rows: slice | None = None) -> View:
    edges_ns = np.linspace(-exposure_ms / 2, exposure_ms / 2, sub_frames + 1) * MS_NS
    poses = np.broadcast_to(AHEAD, (sub_frames, 4, 4))
    stamps_ns = edges_ns.astype(np.int64)
    return View(rows or slice(0, camera.height_px), poses, stamps_ns[:-1], stamps_ns[1:])


def cover_of(drop: Any, *views: View, scene: Scene | None = None, camera: Camera = CAMERA) -> Array:
    streaks = RainStreaks(scene or yard(), RAIN)
    streaks._drops = drop
    return streaks.cover(camera, views).astype(float)


def moments(cover: Array) -> tuple[float, float]:
    """The mean row of a cover, and its variance."""
    by_row = cover.sum(1)
    rows = np.arange(len(by_row))
    mean = float((by_row * rows).sum() / by_row.sum())
    return mean, float((by_row * (rows - mean) ** 2).sum() / by_row.sum())


def yard(*things: Thing) -> Scene:
    ground = Thing("ground", quad((-50, -50, 0), (100, 0, 0), (0, 100, 0)), "grey")
    return Scene("yard", (ground, *things), MATERIALS, (SKY,), rain=RAIN)


@pytest.mark.parametrize(("fall_mps", "exposure_ms"), [(4.0, 20.0), (8.0, 20.0), (8.0, 10.0)])
def test_a_streak_is_as_long_as_speed_times_exposure(fall_mps: float, exposure_ms: float) -> None:
    depth_m = 1.0
    drop = OneDrop((depth_m, 0, 1), fall_mps=fall_mps)
    mean, variance = moments(cover_of(drop, exposure(exposure_ms)))
    _, variance_of_dot = moments(cover_of(drop, exposure(0.0)))
    length_px = CAMERA.fy_px * fall_mps * exposure_ms * 1e-3 / depth_m
    assert mean == pytest.approx(CAMERA.cy_px, abs=0.01)
    uniform_px = np.sqrt(12 * (variance - variance_of_dot))  # the length of a line of this variance
    assert uniform_px == pytest.approx(length_px, rel=0.02)


@pytest.mark.parametrize("exposure_ms", [0.0, 2.0, 20.0])
@pytest.mark.parametrize("depth_m", [0.5, 2.0, 6.0])
def test_a_drop_covers_its_area_whatever_the_exposure(depth_m: float, exposure_ms: float) -> None:
    diameter_m = 2e-3
    drop = OneDrop((depth_m, 0, 1), fall_mps=4.0, diameter_m=diameter_m)
    cover = cover_of(drop, exposure(exposure_ms))
    assert cover.sum() == pytest.approx(np.pi / 4 * (CAMERA.fx_px * diameter_m / depth_m) ** 2, rel=1e-3)


def test_a_near_drop_is_blurred_as_widely_as_the_aperture_would_be_there() -> None:
    depth_m = 0.12
    cover = cover_of(OneDrop((depth_m, 0, 1), diameter_m=4e-3), exposure(0.0))
    width_px = CAMERA.fx_px * np.hypot(4e-3, APERTURE_M) / depth_m
    assert np.sqrt(4 / np.pi * (cover > 0.01).sum()) == pytest.approx(width_px, rel=0.25)


def test_as_many_sub_frames_give_the_same_streak() -> None:
    drop = OneDrop((2.0, 0, 1), fall_mps=4.0)
    one = cover_of(drop, exposure(10.0))
    many = cover_of(drop, exposure(10.0, sub_frames=8))
    np.testing.assert_allclose(many, one, atol=0.1 * one.max())
    assert many.sum() == pytest.approx(one.sum(), rel=1e-3)


def test_under_a_rolling_shutter_a_strip_shows_the_drop_when_it_is_exposed() -> None:
    """The lower strip is exposed 20 ms later, when the drop has fallen by 8 cm."""
    drop = OneDrop((2.0, 0, 1.05), fall_mps=4.0)
    upper = exposure(0.0, rows=slice(0, 58))
    lower = View(slice(58, 120), upper.T_world_camera, upper.start_ns + 20 * MS_NS, upper.end_ns + 20 * MS_NS)
    by_row = cover_of(drop, upper, lower).sum(1)
    rows = np.flatnonzero(by_row > 0.1 * by_row.max())
    at_first = CAMERA.cy_px - CAMERA.fy_px * 0.05 / 2
    at_last = CAMERA.cy_px + CAMERA.fy_px * 0.03 / 2
    assert abs(rows[rows < 58].mean() - at_first) < 1
    assert abs(rows[rows >= 58].mean() - at_last) < 1


def test_a_fisheye_sees_the_drop_where_its_model_says() -> None:
    position_m = np.array([1.0, 0.8, 1.3])
    cover = cover_of(OneDrop(position_m, diameter_m=6e-3), exposure(0.0, FISHEYE), camera=FISHEYE)
    v, u = np.mgrid[: FISHEYE.height_px, : FISHEYE.width_px]
    seen_px = np.array([(cover * u).sum(), (cover * v).sum()]) / cover.sum()
    in_camera = (np.append(position_m, 1) @ np.linalg.inv(AHEAD).T)[:3]
    np.testing.assert_allclose(seen_px, FISHEYE.project(in_camera), atol=0.05)


@pytest.mark.parametrize(("material", "is_seen"), [("grey", False), ("glass", True)])
def test_a_wall_hides_drops_behind_it_and_a_pane_does_not(material: str, is_seen: bool) -> None:
    wall = Thing("wall", quad((1.5, 5, -5), (0, -10, 0), (0, 0, 10)), material)
    cover = cover_of(OneDrop((2.0, 0, 1)), exposure(0.0), scene=yard(wall))
    assert (cover.sum() > 0) == is_seen


def test_no_drop_falls_below_a_roof() -> None:
    roof = Thing("roof", quad((1, -5, 4), (0, 10, 0), (10, 0, 0)), "grey")  # visible from below
    under = cover_of(OneDrop((2.0, 0, 1), fall_mps=4.0), exposure(0.0), scene=yard(roof))
    before = cover_of(OneDrop((0.8, 0, 1), fall_mps=4.0), exposure(0.0), scene=yard(roof))
    assert under.sum() == 0
    assert before.sum() > 0


def test_drops_replace_the_light_behind_them_by_that_around(draw: Any, even_light: Any) -> None:
    """Half of their light is the sky's, half is that of surfaces, as far as a pixel is covered."""
    dry = draw(even_light(Scene("yard", yard().things, MATERIALS, (SKY,))))
    baked = even_light(yard())
    wet = draw(baked)
    view = exposure(10.0)
    before = dry.radiance(CAMERA, [view], weights=LUMINANCE).astype(float)
    after = wet.radiance(CAMERA, [view], weights=LUMINANCE).astype(float)
    cover = RainStreaks(yard(), RAIN).cover(CAMERA, [view]).astype(float)
    drop_cd_m2 = (1000 / np.pi + 0.2 * 100 / np.pi) / 2
    is_sky = np.zeros(before.shape, bool)
    is_sky[:50] = True  # where no distant drops are drawn
    expected = before + cover * (drop_cd_m2 - before)
    assert cover[is_sky].max() > 0.01
    np.testing.assert_allclose(after[is_sky], expected[is_sky], rtol=1e-4)


def test_distant_drops_are_a_veil_over_surfaces(draw: Any, even_light: Any) -> None:
    shown = yard()
    view = exposure(0.0)
    dry = draw(even_light(Scene("yard", shown.things, MATERIALS, (SKY,))))
    wet = draw(even_light(shown))
    before = dry.radiance(CAMERA, [view], weights=LUMINANCE).astype(float)
    after = wet.radiance(CAMERA, [view], weights=LUMINANCE).astype(float)
    is_clear = RainStreaks(shown, RAIN).cover(CAMERA, [view]) == 0
    row = 65  # the ground at 27 m
    distance_m = CAMERA.fy_px / (row - CAMERA.cy_px) * 1.0
    passing = np.exp(-RAIN.extinction_per_m * distance_m)
    drop_cd_m2 = (1000 / np.pi + 0.2 * 100 / np.pi) / 2
    expected = passing * before[row] + (1 - passing) * drop_cd_m2
    middle = is_clear[row] & (np.abs(np.arange(CAMERA.width_px) - CAMERA.cx_px) < 20)
    assert middle.any()
    np.testing.assert_allclose(after[row][middle], expected[middle], rtol=0.02)
