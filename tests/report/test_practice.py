"""The recordings that an estimator is tried on: each is what its name says."""

import numpy as np
import pytest

from vobench.report.practice import (
    BASELINE_M,
    FIRST_CHANGED,
    FOCAL_PX,
    FRAMES,
    HEIGHT_M,
    LAST_CHANGED,
    PRACTICES,
    RIG,
    STEP_M,
    STEP_NS,
    Practice,
    changed_from_middle,
)
from vobench.runner.folder import read_tum
from vobench.runner.frames import GROUND_TRUTH
from vobench.sequence import Sequence

STEP_PX = round(FOCAL_PX * STEP_M / HEIGHT_M)
DISPARITY_PX = round(FOCAL_PX * BASELINE_M / HEIGHT_M)
NOISE_DN = 4  # of two pictures together


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    place = tmp_path_factory.mktemp("practice")
    return {name: practice.write(place / name) for name, practice in PRACTICES.items()}


@pytest.fixture
def recordings(folders):
    return {name: Sequence.open(folder) for name, folder in folders.items()}


def distance(one, other):
    return int(np.abs(one.astype(int) - other.astype(int)).max())


def test_the_floor_moves_down_the_picture_by_its_distance(recordings):
    drive = recordings["drive"]
    for index in range(1, FRAMES):
        before, now = drive[index - 1].left, drive[index].left
        assert distance(now[STEP_PX:], before[:-STEP_PX]) <= NOISE_DN
    assert distance(drive[1].left, drive[0].left) > 50


def test_the_right_picture_is_shifted_by_the_disparity(recordings):
    frame = recordings["drive"][5]
    assert distance(frame.right[:, :-DISPARITY_PX], frame.left[:, DISPARITY_PX:]) <= NOISE_DN


def test_no_two_pictures_have_the_same_noise(recordings):
    still = recordings["standstill"]
    assert 0 < distance(still[0].left, still[1].left) <= NOISE_DN
    assert distance(still[3].left[:, DISPARITY_PX:], still[3].right[:, :-DISPARITY_PX]) > 0


def test_the_truth_is_a_straight_line_and_at_rest_a_point(folders):
    drive = read_tum(folders["drive"] / GROUND_TRUTH)
    np.testing.assert_array_equal(drive.t_ns, np.arange(FRAMES) * STEP_NS)
    np.testing.assert_allclose(np.linalg.norm(np.diff(drive.positions_m, axis=0), axis=1), STEP_M, atol=1e-6)
    assert np.ptp(read_tum(folders["standstill"] / GROUND_TRUTH).positions_m, axis=0).max() == 0


@pytest.mark.parametrize(("name", "last"), [("black", LAST_CHANGED), ("other end", FRAMES)])
def test_pictures_are_changed_from_the_middle_on_and_nowhere_else(recordings, name, last):
    drive, changed = recordings["drive"], recordings[name]
    differing = [index for index in range(FRAMES) if distance(drive[index].left, changed[index].left)]
    assert differing == list(range(FIRST_CHANGED, last))


def test_black_pictures_are_black_and_the_others_upside_down(recordings):
    assert not recordings["black"][FIRST_CHANGED].left.any()
    drive, other = recordings["drive"][FRAMES - 1], recordings["other end"][FRAMES - 1]
    np.testing.assert_array_equal(other.left, drive.left[::-1])
    np.testing.assert_array_equal(other.right, drive.right[::-1])


def test_three_pictures_are_missing(recordings):
    stamps = {frame.t_ns for frame in recordings["missing"]}
    every = {index * STEP_NS for index in range(FRAMES)}
    assert every - stamps == {index * STEP_NS for index in range(FIRST_CHANGED, LAST_CHANGED)}


def test_wheels_turn_with_the_distance_and_the_imu_stands_level(recordings):
    wheels = RIG.wheels
    turns = STEP_M * (FRAMES - 1) / (2 * np.pi * wheels.radius_m)
    ticks = round(turns * wheels.ticks_per_revolution)
    assert recordings["drive"].encoders()[1][-1].tolist() == [ticks, ticks]
    assert recordings["standstill"].encoders()[1][-1].tolist() == [0, 0]
    imu = recordings["drive"].imu()
    assert set(np.diff(imu.t_ns)) == {5_000_000}
    assert imu.t_ns[-1] == (FRAMES - 1) * STEP_NS
    np.testing.assert_allclose(imu.accel_mps2[0], [0, 0, 9.81])


def test_a_change_keeps_the_frames_around_it():
    change = changed_from_middle(lambda picture: picture + 1)
    picture = np.zeros((2, 2), np.uint8)
    changed = [index for index in range(FRAMES) if change(index, picture) is not picture]
    assert changed == list(range(FIRST_CHANGED, LAST_CHANGED))
    assert Practice().change(0, picture) is picture
