"""A twin's path lies free in its place, its camera looks as it should, and orders are compared fairly."""

import numpy as np
import pytest

from vobench.analysis import twin
from vobench.analysis.twin import (
    LOST,
    WELL_E,
    agreement,
    camera_of,
    fit_camera,
    levelled,
    look_of,
    place_path,
    segment_errors,
    stretch_disparities,
)
from vobench.errors import InputError
from vobench.estimator.tools import stereo_pair
from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import looking, stereo_rig
from vobench.rendering.geometry import RayCaster
from vobench.scene.material import Material
from vobench.scene.mesh import Thing, flat, flipped
from vobench.scene.scene import Scene, triangles
from vobench.sensor.image_sensor import NoiseStreams, expose
from vobench.sensor.lens import lens_maps, through_lens
from vobench.trajectory.trajectory import Trajectory

LENS = Pinhole(160, 120, 150.0, 150.0, 79.5, 59.5)
PAIR = stereo_pair(stereo_rig(LENS, pitch_deg=0, baseline_m=0.2), "test")


@pytest.fixture(autouse=True)
def few_draws(monkeypatch):
    monkeypatch.setattr(twin, "DRAWS", 600)
    monkeypatch.setattr(twin, "NEAR_DRAWS", 200)


def hall(*, pillar: bool = False) -> Scene:
    """A room of 8 x 6 x 3 m seen from within, and perhaps a pillar that leaves no way through its middle."""
    boxes = [((-4, -3, 0), (4, 3, 3), True), *([((-2.9, -1.9, 0), (2.9, 1.9, 2.9), False)] if pillar else [])]
    things = []
    for number, (low, high, inward) in enumerate(boxes):
        corners = np.array(
            [[(low, high)[i >> 2 & 1][0], (low, high)[i >> 1 & 1][1], (low, high)[i & 1][2]] for i in range(8)], float
        )
        faces = np.array(
            [
                [0, 1, 3],
                [0, 3, 2],
                [4, 6, 7],
                [4, 7, 5],
                [0, 4, 5],
                [0, 5, 1],
                [2, 3, 7],
                [2, 7, 6],
                [0, 2, 6],
                [0, 6, 4],
                [1, 5, 7],
                [1, 7, 3],
            ]
        )
        corners_m = corners[faces]
        vertices = corners_m.reshape(-1, 3)
        mesh = flat(vertices, np.arange(len(vertices)).reshape(-1, 3), np.zeros((len(vertices), 2)))
        outward = np.einsum("ij,ij->i", mesh.vertex_normals[::3], corners_m.mean(1) - corners.mean(0)) > 0
        turned = flipped(mesh) if outward.all() == inward else mesh
        things.append(Thing(f"box_{number}", turned, "paint"))
    return Scene("hall", tuple(things), {"paint": Material()}, ())


def straight(length_m: float, count: int = 20) -> np.ndarray:
    way = np.zeros((count, 3))
    way[:, 0] = np.linspace(0, length_m, count)
    return se3.transform(np.eye(3), way) @ looking(pitch_deg=0, position_m=(0, 0, 0))


def test_a_path_lies_free_and_its_disparities_agree():
    wanted = np.full((1, 3, 3), 150 * 0.2 / 2.5)
    found = place_path(hall(), straight(1.5), PAIR, wanted)
    places = (found.T_place_world @ straight(1.5))[:, :3, 3] / found.scale
    assert (np.abs(places) < [3.9, 2.9, 3.0]).all()
    assert found.misfit < 0.5
    assert place_path(hall(), straight(1.5), PAIR, wanted / 20).scale > 1.5  # a hall of 8 m has nothing so far away


def test_where_a_path_was_is_found_by_its_disparities_along_the_way():
    scene = hall()
    there = se3.transform(se3.rotation_z(0.4), (-2.5, 0.6, 1.2)) @ straight(4.0)
    wanted = stretch_disparities(RayCaster(triangles(scene, t_ns=0)), there, PAIR, 1.0, 4)
    found = place_path(scene, straight(4.0), PAIR, wanted)
    ends = (found.T_place_world @ straight(4.0))[[0, -1], :2, 3] / found.scale
    assert found.misfit < 0.05
    # The hall is its own image when it is turned by half.
    assert min(np.abs(sign * ends - there[[0, -1], :2, 3]).max() for sign in (1, -1)) < 0.25


def test_a_place_without_a_free_way_is_refused():
    with pytest.raises(InputError, match=r"no free way of 60.0 m was found in 'hall'; take fewer pictures"):
        place_path(hall(pillar=True), straight(60.0), PAIR, np.full((1, 3, 3), 10.0))


def test_a_tilted_world_is_levelled():
    turn = np.linspace(0, 5, 60)
    circle = np.stack([np.cos(turn), np.sin(turn), np.zeros(60)], -1) * 3
    level = se3.transform(np.eye(3), circle)
    tilt = se3.transform(se3.rotation_z(0.3) @ looking(pitch_deg=-8, position_m=(0, 0, 0))[:3, [2, 0, 1]], np.zeros(3))
    assert np.ptp((tilt @ level)[:, 2, 3]) > 0.5
    assert np.ptp(levelled(tilt @ level)[:, 2, 3]) < 0.02


def light() -> np.ndarray:
    rng, picture = np.random.default_rng(3), np.full((120, 160), 0.4, np.float32)
    for _ in range(25):
        x, y = rng.integers(0, 150), rng.integers(0, 110)
        picture[y : y + rng.integers(8, 40), x : x + rng.integers(8, 50)] = rng.uniform(0.05, 1.2)
    return picture


def develop(settings):
    maps = lens_maps(settings, LENS, np.random.default_rng(0))
    noise = NoiseStreams(np.random.default_rng(1), np.random.default_rng(2))
    return [expose(through_lens(light(), maps), settings, noise)]


def test_a_cameras_exposure_contrast_blur_and_noise_are_found():
    wanted = look_of(develop(camera_of(0.8, 0.6, 0.9, 1.8)))
    settings, look = fit_camera(wanted, develop)
    assert look.mean_dn == pytest.approx(wanted.mean_dn, rel=0.05)
    assert look.sd_dn == pytest.approx(wanted.sd_dn, rel=0.1)
    assert look.noise_dn == pytest.approx(wanted.noise_dn, rel=0.15)
    assert settings.chip.full_well_e == pytest.approx(WELL_E / 1.8**2, rel=0.3)
    assert settings.blur_sigma_px == pytest.approx(0.9, abs=0.25)


def walk(scale: float = 1.0, drift: float = 0.0) -> Trajectory:
    places = np.stack([np.linspace(0, 10, 100), np.linspace(0, 10, 100) ** 2 * drift, np.zeros(100)], -1)
    return Trajectory(np.arange(100) * 10**8, se3.transform(np.eye(3), places * scale))


def test_an_error_of_scale_is_that_share_of_every_segment():
    errors = segment_errors(walk(), walk(1.02))
    assert np.nanmin(errors) == pytest.approx(2)
    assert np.nanmax(errors) == pytest.approx(2)
    assert np.nanmax(segment_errors(walk(), walk(1.02), scaled=True)) < 1e-6


def test_a_missing_pose_is_a_lost_segment():
    half = Trajectory(walk().t_ns[:50], walk().T_world_frame[:50])
    errors = segment_errors(walk(), half)
    assert np.nanmax(errors) == LOST
    assert np.isfinite(errors).sum() == np.isfinite(segment_errors(walk(), walk())).sum()
    nothing = segment_errors(walk(), Trajectory(half.t_ns[:0], half.T_world_frame[:0]))
    assert np.nanmin(nothing) == LOST


def test_equal_orders_have_tau_1_and_reversed_ones_minus_1():
    drifts = {name: segment_errors(walk(), walk(1 + 0.01 * n)) for n, name in enumerate("abcdef", 1)}
    same = agreement(drifts, drifts)
    assert [same.tau, same.low, same.high] == pytest.approx([1, 1, 1])
    turned = dict(zip(drifts, reversed(drifts.values()), strict=True))
    assert agreement(drifts, turned).tau == pytest.approx(-1)
    with pytest.raises(InputError, match="3 estimators or more"):
        agreement(drifts, {"a": drifts["a"]})
