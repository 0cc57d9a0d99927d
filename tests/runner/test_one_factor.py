"""One factor, one change: whatever is switched on, every other channel stays the same to the last bit."""

import hashlib
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from vobench.runner.task import missing, perform, sequence_tasks
from vobench.sequence import Sequence, payload_hash, read_disturbances, read_truth
from vobench.suite.suite import read_plan

SCENE = """name: cell
white_cd_m2: 50
materials:
  grain: {pattern: terrazzo, albedo: 0.5, contrast: 0.6, resolution_px: 256}
PLACE
lamps: [{name: lamp, center_m: [0, 0, 1.4], size_m: [0.4, 0.4], power_lm: 600}]
AIR"""
SUITE = """name: one
seed: 3
scenes: [SCENE]
rigs: {down: {picture_scale: 0.5, pitch_deg: 90, imu: IMUCALIBRATION}}
lightings: {it: LIGHTING}
trajectories: {short: {targets_m: [[0.3, 0.05]], tolerance_m: 0.1, rate_hz: 2, slip: SLIP, encoders: ENCODERSFLOOR}}
cameras: {it: {sensor: mt9v034CAMERA}}
truth: TRUTH
estimators: [stand_still]
"""
DEFAULTS = {
    "CALIBRATION": "",
    "IMU": "{like: adis16448}",
    "LIGHTING": "{}",
    "SLIP": "nominal",
    "ENCODERS": "nominal",
    "FLOOR": "",
    "CAMERA": "",
    "TRUTH": "[]",
    "AIR": "",
    "PLACE": "room: {size_m: [3, 3, 1.5], floor: grain, wall: grain, ceiling: grain}",
}
SLAB = "boxes: [{name: slab, center_m: [0, 0, -0.05], size_m: [4, 4, 0.1], material: grain}]"
LEFT, RIGHT = "sensors/cam_left/image/compressed", "sensors/cam_right/image/compressed"
PICTURES = {LEFT, RIGHT}
READINGS, BIAS = "sensors/imu", "truth/ground_truth/imu_bias"
# Says how to rectify both pictures, so it may know of the right camera.
RECTIFIED_LEFT = "truth/ground_truth/cam_left/camera_info"
# A factor, and the channels that it may change, and so must.
FACTORS = {
    "read noise": ({"CAMERA": ", chip: {read_noise_e: 0}"}, PICTURES),
    "shot noise": ({"CAMERA": ", chip: {shot_noise: false}"}, PICTURES),
    "fixed pattern": ({"CAMERA": ", chip: {prnu: 0, dsnu_e: 0}"}, PICTURES),
    "hot pixels": ({"CAMERA": ", chip: {hot_share: 0.01}"}, PICTURES),
    "response": ({"CAMERA": ", chip: {response: linear}"}, PICTURES),
    "vignetting": ({"CAMERA": ", vignetting: 1"}, PICTURES),
    "lens blur": ({"CAMERA": ", blur_sigma_px: 1"}, PICTURES),
    "dirt": ({"CAMERA": ", dirt: 0.1"}, PICTURES),
    "drops on the lens": ({"CAMERA": ", lens_drops: 0.2"}, PICTURES),
    "motion blur": ({"CAMERA": ", exposure_ms: 40, motion_blur: true"}, {*PICTURES, "sensors/exposure"}),
    "rolling shutter": ({"CAMERA": ", shutter: rolling, readout_ms: 30"}, PICTURES),
    "auto-exposure": (
        {"CAMERA": ", auto_exposure: {target_share: 0.05, t_max_ms: 30}"},
        {*PICTURES, "sensors/exposure"},
    ),
    "JPEG": ({"CAMERA": ", jpeg_quality: 90"}, PICTURES),
    "light": ({"LIGHTING": "{lamp: {level: {flicker: {depth: 0.5}}}}"}, PICTURES),
    "calibration": (
        {"CALIBRATION": ", calibration_error: {right_yaw_deg: 1}"},
        {RIGHT, "truth/tf_static", "truth/ground_truth/cam_right/camera_info", RECTIFIED_LEFT},
    ),
    "worn calibration": (
        {"CALIBRATION": ", calibration_error: worn"},
        {*PICTURES, "truth/tf_static", "truth/ground_truth/cam_right/camera_info", RECTIFIED_LEFT},
    ),
    "a darker right eye": ({"CAMERA": ", unlike: {right: {gain: 0.8, blur_sigma_px: 0.5, dirt: 0.1}}"}, {RIGHT}),
    "a late right eye": ({"CAMERA": ", timing: {right_delay_ms: 40}"}, {RIGHT}),
    "jitter": ({"CAMERA": ", timing: {jitter_ms: 20}"}, PICTURES),
    "repeats": ({"CAMERA": ", timing: {repeat_share: 0.9}"}, PICTURES),
    "IMU noise": ({"IMU": "{like: adis16448, gyro: {noise: 1.0e-3}}"}, {READINGS}),
    "IMU bias": ({"IMU": "{like: adis16448, accel: {bias: [0.1, 0, 0]}}"}, {READINGS, BIAS}),
    "IMU walk": ({"IMU": "{like: adis16448, gyro: {walk: 1.0e-3}}"}, {READINGS, BIAS}),
    "IMU place": (
        {"IMU": "{like: adis16448, position_m: [0.1, 0, 0]}"},
        {READINGS, "sensors/tf_static", "truth/tf_static"},
    ),
    "IMU rate": ({"IMU": "{like: adis16448, rate_hz: 100}"}, {READINGS, BIAS}),
    "no IMU": ({"IMU": "null"}, {READINGS, BIAS, "sensors/tf_static", "truth/tf_static"}),
    "floor elsewhere": ({"FLOOR": ", floor: [{surface: wet, center_m: [0, 1], size_m: [0.5, 0.5]}]"}, set()),
    "encoders": ({"ENCODERS": "exact"}, {"sensors/encoders"}),
    "fog": ({"AIR": "fog: {visibility_m: 5}\n"}, PICTURES),
    "truth of pixels": ({"TRUTH": "[depth, flow, occlusion]"}, set()),
}


def recorded(folder: Path, *, cache: Path | None = None, **factors: str) -> Path:
    """The sequence of the suite with these texts in place of its defaults; made anew without a cache."""
    (folder / "scenes").mkdir(parents=True)
    texts = {**DEFAULTS, **factors}
    scene = SCENE.replace("AIR", texts.pop("AIR")).replace("PLACE", texts.pop("PLACE"))
    (folder / "scenes" / "cell.yaml").write_text(scene)
    text = SUITE.replace("SCENE", str(folder / "scenes" / "cell.yaml"))
    for key, value in texts.items():
        text = text.replace(key, value)
    (folder / "one.yaml").write_text(text)
    (case,) = read_plan(str(folder / "one.yaml")).cases
    tasks, store = sequence_tasks(case), cache or folder / "cache"
    for task in missing(tasks, store):
        perform(task, store)
    return store / tasks[-1].key


def channels(sequence: Path) -> dict[str, str]:
    """A digest of each channel of both files."""
    digests = {}
    for name in ("sensors", "truth"):
        with (sequence / f"{name}.mcap").open("rb") as file:
            for _, channel, message in make_reader(file).iter_messages():
                digest = digests.setdefault(f"{name}{channel.topic}", hashlib.sha256())
                digest.update(message.data)
    return {topic: digest.hexdigest() for topic, digest in digests.items()}


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the cases share their light."""
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(scope="module")
def base(tmp_path_factory: pytest.TempPathFactory, cache: Path) -> Path:
    return recorded(tmp_path_factory.mktemp("base") / "it", cache=cache)


@pytest.fixture(scope="module")
def dry(tmp_path_factory: pytest.TempPathFactory, cache: Path) -> Path:
    """The same without slip."""
    return recorded(tmp_path_factory.mktemp("dry") / "it", cache=cache, SLIP="none")


@pytest.mark.parametrize("name", FACTORS)
def test_switching_one_effect_changes_its_own_channels_and_no_other(base, cache, tmp_path, name):
    factors, may_change = FACTORS[name]
    before, after = channels(base), channels(recorded(tmp_path / "it", cache=cache, **factors))
    changed = {topic for topic in before if before[topic] != after.get(topic)}
    assert changed <= may_change
    assert changed >= may_change - {RECTIFIED_LEFT}


def test_fog_changes_pictures_but_no_truth_of_pixels(cache, tmp_path):
    clear = channels(recorded(tmp_path / "clear", cache=cache, TRUTH="[depth, flow, occlusion]"))
    foggy = channels(
        recorded(tmp_path / "foggy", cache=cache, TRUTH="[depth, flow, occlusion]", AIR="fog: {visibility_m: 5}\n")
    )
    assert any("depth" in topic for topic in clear)
    assert {topic for topic in clear if clear[topic] != foggy[topic]} == PICTURES


@pytest.mark.slow
def test_rain_changes_pictures_but_no_truth_of_pixels(cache, tmp_path):
    """In the open, where the ground is wet, and drops fall; truth is that of the solid ground."""
    sky = "sky: {illuminance_lx: 300}\n"
    outdoors = {"TRUTH": "[depth, flow, occlusion]", "PLACE": SLAB}
    dry = channels(recorded(tmp_path / "dry", cache=cache, AIR=sky, **outdoors))
    rainy = channels(recorded(tmp_path / "rainy", cache=cache, AIR=sky + "rain: {rate_mm_per_h: 100}\n", **outdoors))
    assert any("depth" in topic for topic in dry)
    assert {topic for topic in dry if dry[topic] != rainy[topic]} == PICTURES


def test_slip_changes_the_way_but_no_noise_of_the_chip(base, dry):
    """Before the robot has moved, both drives look from the same place: the first pictures are one and the same."""
    first, other = (next(iter(Sequence.open(folder).frames())) for folder in (base, dry))
    np.testing.assert_array_equal(first.left, other.left)
    assert channels(base)["truth/ground_truth/odometry"] != channels(dry)["truth/ground_truth/odometry"]


def test_the_slip_of_every_frame_is_recorded_as_truth(base, dry):
    (stamps, wet), (_, none) = read_disturbances(base), read_disturbances(dry)
    np.testing.assert_array_equal(stamps, read_truth(base).t_ns)
    assert (wet[:, :3].std(0) > 0).all()
    assert not wet[:, 3:].any()
    assert not none.any()


@pytest.mark.slow
def test_recordings_on_fresh_caches_in_this_process_and_in_another_are_the_same_bytes(base, tmp_path):
    again = recorded(tmp_path / "again")
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as worker:
        beside = worker.submit(recorded, tmp_path / "beside").result()
    assert len({payload_hash(sequence) for sequence in (base, again, beside)}) == 1
    for name in ("sensors.mcap", "truth.mcap"):
        assert len({(sequence / name).read_bytes() for sequence in (base, again, beside)}) == 1


def test_a_window_of_frames_holds_what_the_whole_recording_has_there(base, cache, tmp_path):
    window = recorded(tmp_path / "it", cache=cache, TRUTH="[]\nframes: [1, 4]")
    whole, part = list(Sequence.open(base).frames())[1:4], list(Sequence.open(window).frames())
    assert [frame.t_ns for frame in part] == [frame.t_ns for frame in whole]
    for one, other in zip(part, whole, strict=True):
        np.testing.assert_array_equal(one.left, other.left)
        np.testing.assert_array_equal(one.right, other.right)
    np.testing.assert_array_equal(read_truth(window).T_world_frame, read_truth(base).T_world_frame[1:4])
    np.testing.assert_array_equal(read_disturbances(window)[1], read_disturbances(base)[1][1:4])
    (t_ns, counts), (all_ns, all_counts) = Sequence.open(window).encoders(), Sequence.open(base).encoders()
    kept = (all_ns >= part[0].t_ns) & (all_ns <= part[-1].t_ns)
    np.testing.assert_array_equal(t_ns, all_ns[kept])
    np.testing.assert_array_equal(counts, (all_counts - all_counts[kept][0])[kept])
