"""A patch of floor acts where the wheels are on it, and nowhere else."""

from dataclasses import replace
from functools import cache
from math import pi

import numpy as np
import pytest

from vobench.errors import MotionError
from vobench.geometry import se3
from vobench.robot.disturbance import MOST_SLIP, STREAMS
from vobench.robot.drive import Drive, drive
from vobench.robot.floor import SURFACES, FloorPatch, Surface, under
from vobench.robot.slip import SLIPS

NOMINAL = SLIPS["nominal"]
FAR, EVERYWHERE = ((9.0, 9.0), (1.0, 1.0)), ((0.0, 0.0), (20.0, 20.0))


@cache
def driven(*patches: FloorPatch) -> Drive:
    rngs = dict(zip(STREAMS, np.random.default_rng(1).spawn(6), strict=True))
    return drive([(1.5, 0.0)], slip=NOMINAL, floor=patches, rngs=rngs)


def test_a_patch_holds_the_points_inside_its_turned_rectangle() -> None:
    patch = FloorPatch(SURFACES["wet"], (1.0, 2.0), (2.0, 0.2), yaw_rad=pi / 2)
    assert [patch.holds(1.05, y) for y in (1.01, 2.99, 3.01)] == [True, True, False]
    assert not patch.holds(1.11, 2.0)


def test_a_patch_turns_with_its_yaw_about_its_center() -> None:
    flat, turned = (FloorPatch(SURFACES["wet"], (1.0, 2.0), (2.0, 0.5), yaw_rad=yaw) for yaw in (0.0, 0.7))
    R = se3.rotation_z(0.7)[:2, :2]
    for offset in np.random.default_rng(0).uniform(-1.5, 1.5, (200, 2)):
        assert turned.holds(*np.add(R @ offset, [1, 2]).tolist()) == flat.holds(*np.add(offset, [1, 2]).tolist())


def test_where_patches_overlap_factors_multiply_and_biases_add() -> None:
    patches = [FloorPatch(Surface(f, b, -b), (0.0, 0.0), (1.0, 1.0)) for f, b in ((2.0, 0.01), (3.0, 0.02))]
    assert under(patches, 0.2, 0.2) == (6.0, pytest.approx(0.03), pytest.approx(-0.03))
    assert under(patches, 0.6, 0.2) == (1.0, 0.0, 0.0)


def test_a_patch_that_is_never_crossed_changes_nothing_to_the_last_bit() -> None:
    clean, patched = driven(), driven(FloorPatch(SURFACES["wet"], *FAR))
    np.testing.assert_array_equal(patched.state, clean.state)
    np.testing.assert_array_equal(patched.rim_rad, clean.rim_rad)


def test_a_patch_under_everything_is_the_slip_settings_times_its_factor() -> None:
    rngs = dict(zip(STREAMS, np.random.default_rng(1).spawn(6), strict=True))
    stronger = replace(NOMINAL, ratio_std=2 * NOMINAL.ratio_std, angle_std_rad=2 * NOMINAL.angle_std_rad)
    scaled = drive([(1.5, 0.0)], slip=stronger, rngs=rngs)
    np.testing.assert_allclose(driven(FloorPatch(Surface(2.0), *EVERYWHERE)).state, scaled.state, atol=1e-12)


def test_slip_changes_within_one_frame_of_the_axle_entering_and_leaving_the_patch() -> None:
    run = driven(FloorPatch(Surface(5.0), (0.7, 0.0), (0.4, 3.0)))
    x_m, clean = run.motion.at(run.t_ns).T_world_body[:, 0, 3], driven()
    shared = slice(0, min(len(run.slip), len(clean.slip)))
    factor = run.slip[shared, 2] / clean.slip[shared, 2]
    inside = np.abs(x_m[shared] - 0.7) <= 0.2
    np.testing.assert_allclose(factor[(x_m[shared] < 0.498) | (x_m[shared] > 0.902)], 1.0)
    np.testing.assert_allclose(factor[inside & (np.abs(x_m[shared] - 0.7) < 0.198)], 5.0)
    assert inside.sum() > 10


def test_a_patch_under_one_wheel_makes_only_that_rim_run_ahead() -> None:
    left = driven(FloorPatch(Surface(ratio_bias=0.1, angle_bias_rad=0.2), (0.7, 0.3), (4.0, 0.5)))
    clean = driven()
    np.testing.assert_allclose(left.slip[:, 0], clean.slip[: len(left.slip), 0] + 0.1, atol=1e-12)
    np.testing.assert_array_equal(left.slip[:, 1], clean.slip[: len(left.slip), 1])
    np.testing.assert_array_equal(left.state, clean.state)


def test_a_pull_to_the_left_is_added_to_the_angle_at_which_the_robot_slides() -> None:
    run, clean = driven(FloorPatch(Surface(angle_bias_rad=0.1), *EVERYWHERE)), driven()
    shared = min(len(run.slip), len(clean.slip))
    np.testing.assert_allclose(run.slip[:shared, 2], clean.slip[:shared, 2] + 0.1, atol=1e-12)
    assert (run.motion.at(run.t_ns).velocity_mps[1:shared, 1] > 0).all()


def test_slip_is_cut_before_the_formulas_lose_their_meaning() -> None:
    run = driven(FloorPatch(Surface(50.0, 0.3, 0.3), *EVERYWHERE))
    assert np.abs(run.slip).max() == MOST_SLIP


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: Surface(factor=-1.0), "factor in 0..50"),
        (lambda: Surface(ratio_bias=float("nan")), "ratio_bias"),
        (lambda: FloorPatch(SURFACES["wet"], (0.0, float("nan")), (1.0, 1.0)), "finite center_m"),
        (lambda: FloorPatch(SURFACES["wet"], (0.0, 0.0), (1.0, 0.0)), "positive size_m"),
    ],
)
def test_what_is_no_floor_is_refused(make: object, sentence: str) -> None:
    with pytest.raises(MotionError, match=sentence):
        make()
