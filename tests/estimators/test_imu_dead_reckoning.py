"""Dead reckoning from an IMU: exact for an exact IMU, and what it learns from a standstill."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from tests.estimator.textures import shifted, texture
from tests.estimators.touched import BIAS_RADPS, framed, grainy, readings_at_rest, touched
from tests.estimators.touched import BIASED as CHIP
from vobench.errors import VobenchError
from vobench.estimator import Frame, ImuReadings, Status
from vobench.geometry import se3
from vobench.geometry.rig import LENSES, looking, stereo_rig
from vobench.geometry.se3 import Array
from vobench.motion.course import Circle
from vobench.motion.drive import drive
from vobench.sensor.imu import IMUS, STREAMS, ImuSettings, Triad, measure
from vobench.trajectory.kinematics import Kinematics, Motion

EXACT = replace(IMUS["exact"], position_m=(0.25, -0.1, 0.3), rotation_deg=(-110.0, 0.0, -90.0))
PLACE = EXACT.T_body_imu
BIASED = replace(EXACT, gyro=Triad(bias=(0.01, -0.02, 0.01)), accel=Triad(bias=(0.1, 0.2, -0.1)))
AXES = se3.transform(np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]), np.zeros(3))  # of a camera, its z axis first
NAME = "imu_dead_reckoning"


@cache
def driven() -> Motion:
    return drive(((0, 1), (1, 1))).motion


@dataclass(frozen=True, slots=True)
class Tilted:
    """Another motion, of a body whose x axis looks up, as EuRoC's."""

    motion: Motion
    start_ns: int = 0

    @property
    def end_ns(self) -> int:
        return self.motion.end_ns

    @property
    def breaks_ns(self) -> Array:
        return self.motion.breaks_ns

    def at(self, t_ns: Array) -> Kinematics:
        return self.motion.at(t_ns).of_mounted(looking(pitch_deg=-90, position_m=(0, 0, 0)) @ AXES)


@dataclass(frozen=True, slots=True)
class Waiting:
    """Another motion, after so many seconds at its start."""

    motion: Motion
    waits_s: float
    start_ns: int = 0

    @property
    def end_ns(self) -> int:
        return self.motion.end_ns + round(self.waits_s * 1e9)

    @property
    def breaks_ns(self) -> Array:
        return self.motion.breaks_ns + self.waits_s * 1e9

    def at(self, t_ns: Array) -> Kinematics:
        return self.motion.at(np.asarray(t_ns, float) - self.waits_s * 1e9)


def rig_with(settings: ImuSettings):
    return replace(stereo_rig(LENSES["paper_blender"], pitch_deg=15), imu=settings.calibration)


def frames_of(motion: Motion, settings: ImuSettings, *, rate_hz: float = 30.0, seed: int = 0) -> list[Frame]:
    rngs = dict(zip(STREAMS, np.random.default_rng(seed).spawn(len(STREAMS)), strict=True))
    readings, _ = measure(motion, settings, rngs=rngs)
    stamps = np.rint(np.arange(int(motion.end_ns * rate_hz / 1e9) + 1) * 1e9 / rate_hz).astype(np.int64)
    ends = np.searchsorted(readings.t_ns, stamps, side="right")
    cuts = zip(np.concatenate([[0], ends[:-1]]), ends, strict=True)
    return [
        Frame(
            k, int(stamps[k]), imu=ImuReadings(readings.t_ns[a:b], readings.gyro_radps[a:b], readings.accel_mps2[a:b])
        )
        for k, (a, b) in enumerate(cuts)
    ]


def off_m(results, frames, motion: Motion) -> Array:
    """Distance (N,) of the estimate from the truth at all frames, both seen from the first pose."""
    T = motion.at(np.array([frame.t_ns for frame in frames])).T_world_body
    truth = se3.inverse(T[0]) @ T
    return np.linalg.norm(np.stack([r.T_odom_frame for r in results])[:, :3, 3] - truth[:, :3, 3], axis=1)


@pytest.mark.parametrize("rate_hz", [30.0, 24.0, 300.0])
def test_an_exact_imu_follows_the_body_from_its_own_place_at_every_frame(bed, rate_hz):
    frames = frames_of(driven(), EXACT, rate_hz=rate_hz)
    results = bed.estimated(NAME, rig_with(EXACT), frames)
    assert frames[-1].t_ns > 5e9
    assert off_m(results, frames, driven()).max() < 3e-3
    assert results[-1].status is Status.OK


def test_more_readings_a_second_follow_it_better(bed):
    off = []
    for hz in (100.0, 400.0):
        settings = replace(EXACT, rate_hz=hz)
        frames = frames_of(driven(), settings)
        off.append(off_m(bed.estimated(NAME, rig_with(settings), frames), frames, driven()).max())
    assert off[0] > 4 * off[1]


def test_a_standstill_teaches_it_the_bias_that_would_else_carry_it_away(bed):
    moved = Waiting(driven(), 1.5)
    waited, at_once = (frames_of(motion, BIASED) for motion in (moved, driven()))
    taught = off_m(bed.estimated(NAME, rig_with(BIASED), waited), waited, moved)
    untaught = off_m(bed.estimated(NAME, rig_with(BIASED), at_once), at_once, driven())
    assert untaught[-1] > 2.0
    # What is left is tilt: the accelerometers' bias looks like it.
    assert taught[-1] < 0.5 * untaught[-1]


def test_who_stands_still_stays_where_it_is_and_a_noisy_imu_alone_drifts_away(bed):
    still = Waiting(driven(), 60.0)
    for settings, low, high in ((BIASED, 0.0, 1e-9), (IMUS["adis16448"], 0.1, 1000.0)):
        frames = [frame for frame in frames_of(still, settings) if frame.t_ns < 59e9]
        results = bed.estimated(NAME, rig_with(settings), frames)
        assert low <= np.linalg.norm(results[-1].T_odom_frame[:3, 3]) < high


def test_a_body_that_is_plainly_tilted_is_not_taken_for_level(bed):
    motion = Tilted(Circle(radius_m=1.0, speed_mps=0.3).way())
    assert motion.at(np.zeros(1)).T_world_body[0, :3, 0] == pytest.approx([0, 0, 1])
    settings = IMUS["exact"]
    frames = [frame for frame in frames_of(motion, settings) if frame.t_ns < 5e9]
    results = bed.estimated(NAME, rig_with(settings), frames)
    assert off_m(results, frames, motion).max() < 0.3  # as level it would fall by g t² / 2: 120 m


def test_it_says_so_while_it_does_not_yet_know_whether_it_stands_still(bed):
    frames = frames_of(Waiting(driven(), 2.0), IMUS["adis16448"])[:60]
    statuses = [result.status for result in bed.estimated(NAME, rig_with(IMUS["adis16448"]), frames)]
    assert statuses == [Status.INIT] * 30 + [Status.OK] * 30
    short = bed.estimated(NAME, rig_with(IMUS["adis16448"]), frames, standstill_s=0.5)
    assert [result.status for result in short].count(Status.INIT) == 15


def test_how_the_readings_are_shared_out_among_frames_does_not_matter(bed):
    ends = [
        bed.estimated(NAME, rig_with(EXACT), frames_of(driven(), EXACT, rate_hz=hz)[: int(4 * hz) + 1])[-1]
        for hz in (5.0, 100.0)
    ]
    np.testing.assert_allclose(ends[0].T_odom_frame, ends[1].T_odom_frame, atol=1e-9)


def test_where_on_the_body_the_imu_sits_does_not_matter(bed):
    paths = []
    for imu in (IMUS["exact"], EXACT):
        settings = replace(imu, rate_hz=1000.0)
        results = bed.estimated(NAME, rig_with(settings), frames_of(driven(), settings))
        paths.append(np.stack([r.T_odom_frame for r in results]))
    np.testing.assert_allclose(paths[0], paths[1], atol=1e-3)


def test_a_frame_without_new_readings_goes_on_with_the_last(bed):
    frames = frames_of(driven(), EXACT)
    frames[100] = replace(frames[100], imu=ImuReadings(np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros((0, 3))))
    results = bed.estimated(NAME, rig_with(EXACT), frames[:101])
    assert off_m(results, frames[:101], driven())[-1] < 5e-3


def test_without_an_imu_it_is_lost_and_refuses_a_rig_that_has_none(bed):
    (result,) = bed.estimated(NAME, rig_with(EXACT), [Frame(0, 0)])
    assert (result.status, result.reason) == (Status.LOST, "no_imu")
    with pytest.raises(VobenchError, match="imu_dead_reckoning needs an IMU, and this recording has none"):
        bed.started(NAME, stereo_rig(LENSES["paper_blender"], pitch_deg=15))


STILL = texture()


def pictures(count: int, moved_px=lambda _: 0.0, *, still=STILL) -> list:
    """Pictures of a texture, each with its own noise and moved to the right by so much."""
    rng = np.random.default_rng(1)
    moved = [moved_px(k) for k in range(count)]
    return [(grainy(shifted(still, px, 0) if px else still, rng), None) for px in moved]


def end_m(bed, frames) -> float:
    results = bed.estimated(NAME, rig_with(CHIP), frames)
    return float(np.linalg.norm(results[-1].T_odom_frame[:3, 3]))


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_pictures_find_the_standstill_of_a_rig_that_is_touched(bed, seed):
    readings = touched(readings_at_rest(3.5), seed=seed)
    seen = framed(readings, pictures(60), rate_hz=20)
    unseen = framed(readings, [None] * 60, rate_hz=20)
    assert end_m(bed, seen) < 0.3
    assert end_m(bed, unseen) > 2.0  # the bias of 0.08 rad/s is taken for turning


def test_a_touch_that_swings_the_camera_for_a_moment_is_no_motion(bed):
    swung = pictures(60, lambda k: 2.0 if 6 <= k < 10 else 0.0)
    frames = framed(touched(readings_at_rest(3.5)), swung, rate_hz=20)
    assert end_m(bed, frames) < 0.3


def test_a_steady_turn_that_pictures_show_is_not_taken_for_bias(bed):
    rest = readings_at_rest(2.5)
    turning_radps = rest.gyro_radps - BIAS_RADPS + [0, 0, 0.2]
    readings = ImuReadings(rest.t_ns, turning_radps, rest.accel_mps2)
    turns_deg = []
    for seen in (pictures(40, lambda k: 3.0 * k), [None] * 40):
        last = bed.estimated(NAME, rig_with(CHIP), framed(readings, seen, rate_hz=20))[-1]
        turns_deg.append(np.rad2deg(se3.rotation_angle(last.T_odom_frame[:3, :3])))
    assert turns_deg == pytest.approx([np.rad2deg(0.2 * 39 / 20), 0], abs=0.2)


@pytest.mark.parametrize("dark", [np.zeros((480, 720), np.uint8), np.full((480, 720), 40, np.uint8)])
def test_without_texture_or_light_the_readings_decide(bed, dark):
    hot = dark.copy()
    hot[np.random.default_rng(2).integers(0, 480, 60), np.random.default_rng(3).integers(0, 720, 60)] = 255
    readings = touched(readings_at_rest(2.5))
    blind = bed.estimated(NAME, rig_with(CHIP), framed(readings, pictures(40, still=hot), rate_hz=20))
    unseen = bed.estimated(NAME, rig_with(CHIP), framed(readings, [None] * 40, rate_hz=20))
    np.testing.assert_array_equal([r.T_odom_frame for r in blind], [r.T_odom_frame for r in unseen])


def test_pictures_that_move_leave_the_poses_of_a_drive_unchanged(bed):
    unseen = frames_of(driven(), BIASED)[:60]
    seen = [replace(f, left=pair[0]) for f, pair in zip(unseen, pictures(60, lambda k: 0.3 * k), strict=True)]
    with_pictures, without = (bed.estimated(NAME, rig_with(BIASED), frames) for frames in (seen, unseen))
    poses = np.array([[r.T_odom_frame for r in results] for results in (with_pictures, without)])
    np.testing.assert_array_equal(poses[0, 2:], poses[1, 2:])
    np.testing.assert_allclose(poses[0, :2], poses[1, :2], atol=1e-2)


def test_a_quiet_rest_is_the_same_with_and_without_pictures(bed):
    readings = readings_at_rest(2.5)
    ends = [
        bed.estimated(NAME, rig_with(CHIP), framed(readings, seen, rate_hz=20))[-1].T_odom_frame
        for seen in (pictures(40), [None] * 40)
    ]
    np.testing.assert_array_equal(ends[0], ends[1])
