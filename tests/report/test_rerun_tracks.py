"""Tails follow their tracks, and true epipolar lines pass through what is stationary."""

import numpy as np
import pytest

from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import stereo_rig
from vobench.report.rerun_tracks import MOST_LINES, MOST_TAILS, TAIL_FRAMES, epipolar_lines, track_tails
from vobench.trajectory.trajectory import Trajectory

RIG = stereo_rig(Pinhole(640, 480, 400.0, 400.0, 319.5, 239.5), pitch_deg=0)


def tracks_of(*paths, begins=None):
    """Tracks and steps of points, each at a place per frame, that begin at some frame."""
    begins = begins or [0] * len(paths)
    count = len(paths[0])
    tracks = {}
    steps = {}
    for index in range(1, count):
        living = [path for path, begin in zip(paths, begins, strict=True) if begin < index]
        tracks[index] = np.array([path[index] for path in living]).reshape(-1, 2), np.ones(len(living), bool)
        steps[index] = np.array([path[index - 1] for path in living]).reshape(-1, 2)
    return tracks, steps, count


def line(start, step, count=12):
    return np.array(start, float) + np.arange(count)[:, None] * np.array(step, float)


def test_a_tail_holds_the_last_places_of_its_track_the_oldest_first():
    path = line([10, 20], [3, 1])
    frames = list(track_tails(*tracks_of(path)))
    assert frames[0] == ([], pytest.approx([]))
    for index in range(1, 12):
        (tail,), chosen = frames[index]
        np.testing.assert_array_equal(tail, path[max(0, index - TAIL_FRAMES) : index + 1])
        assert chosen.tolist() == [0]


def test_tracks_that_change_places_in_the_list_keep_their_tails():
    one, other = line([10, 20], [3, 1]), line([90, 50], [-2, 1])
    tracks, steps, count = tracks_of(one, other)
    for index in range(2, count, 2):
        points, inliers = tracks[index]
        tracks[index] = points[::-1], inliers
        steps[index] = steps[index][::-1]
    tails, _ = list(track_tails(tracks, steps, count))[8]
    np.testing.assert_array_equal(tails[0], other[3:9])
    np.testing.assert_array_equal(tails[1], one[3:9])


def test_a_new_track_has_a_tail_of_its_first_step_alone():
    old, new = line([10, 20], [3, 1]), line([90, 50], [-2, 1])
    tails, _ = list(track_tails(*tracks_of(old, new, begins=[0, 6])))[7]
    assert [len(tail) for tail in tails] == [6, 2]
    np.testing.assert_array_equal(tails[1], new[6:8])


def test_a_gap_ends_a_tail():
    path = line([10, 20], [3, 1])
    tracks, steps, count = tracks_of(path)
    del tracks[5], steps[5]
    frames = list(track_tails(tracks, steps, count))
    assert frames[5][0] == []
    assert len(frames[6][0][0]) == 2


@pytest.mark.parametrize(
    ("count", "shown"), [(MOST_TAILS, MOST_TAILS), (MOST_TAILS + 1, 101), (3 * MOST_TAILS, MOST_TAILS)]
)
def test_at_most_so_many_tails_are_shown_evenly_spread(count, shown):
    points = np.arange(2.0 * count).reshape(-1, 2)
    tracks = {1: (points + 0.5, np.ones(count, bool))}
    tails, chosen = list(track_tails(tracks, {1: points}, 2))[1]
    assert len(tails) == len(chosen) == shown
    assert len(set(np.diff(chosen))) == 1


@pytest.fixture
def truth():
    """A camera that moves forwards and turns a little."""
    turn = np.linspace(0, 0.1, 6)
    T = se3.transform(se3.rotation_z(turn), np.stack([0.3 * np.arange(6), 0.02 * np.arange(6), 0 * turn], -1))
    body = Trajectory(np.arange(6, dtype=np.int64) * 10**8, T)
    return body.of_mounted(RIG.T_body_left)


def seen(truth, index, point_m):
    T_camera_world = np.linalg.inv(truth.T_world_frame[index])
    return RIG.left.project(se3.apply(T_camera_world, np.array([point_m])))[0]


@pytest.mark.parametrize("point_m", [[8.0, 0.5, 0.3], [5.0, -1.0, 0.8], [30.0, 3.0, 1.0]])
def test_a_line_passes_through_a_stationary_point(truth, point_m):
    steps = {3: seen(truth, 2, point_m)[None]}
    (curve,) = epipolar_lines(RIG, truth, steps, 3)
    now = seen(truth, 3, point_m)
    along = np.diff(curve, axis=0)
    share = np.clip(((now - curve[:-1]) * along).sum(1) / (along**2).sum(1), 0, 1)
    assert np.linalg.norm(curve[:-1] + share[:, None] * along - now, axis=1).min() < 0.2


def test_lines_end_at_the_picture(truth):
    places = np.random.default_rng(0).uniform([0, 0], [639, 479], (40, 2))
    curves = epipolar_lines(RIG, truth, {3: places}, 3)
    assert curves
    for curve in curves:
        assert len(curve) >= 2
        assert (curve > -0.5).all()
        assert (curve < [639.5, 479.5]).all()


@pytest.mark.parametrize(
    ("count", "most"), [(MOST_LINES, MOST_LINES), (2 * MOST_LINES, MOST_LINES), (3 * MOST_LINES - 1, 60)]
)
def test_not_every_track_has_a_line(truth, count, most):
    places = np.tile([320.0, 200.0], (count, 1))
    assert len(epipolar_lines(RIG, truth, {3: places}, 3)) == most


def test_the_first_frame_one_without_tracks_and_one_beyond_the_truth_have_none(truth):
    places = np.array([[320.0, 200.0]])
    steps = dict.fromkeys((0, 2, 6, 7), places)
    assert [bool(epipolar_lines(RIG, truth, steps, index)) for index in (0, 1, 2, 6, 7)] == [
        False,
        False,
        True,
        False,
        False,
    ]
