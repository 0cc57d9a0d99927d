"""Each fault is named, on real and made-up trajectories, and what is only noisy gets no name."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vobench.analysis.diagnose import _is_clear_gain, _is_unrelated, _unrelated, _wrong_scale, diagnose
from vobench.errors import AlignmentError
from vobench.geometry import se3
from vobench.runner.trajectory_pair import TrajectoryReading
from vobench.trajectory.any_format import parse_any
from vobench.trajectory.kitti import parse_times
from vobench.trajectory.trajectory import Trajectory, parse_pose_convention

DATA = Path(__file__).parents[2] / ".." / "shared" / "data" / "trajectories"
WITH_DATA = pytest.mark.skipif(not DATA.is_dir(), reason="no folder ../shared/data with real trajectories")
CAMERA = se3.transform([[0, 0, 1], [-1, 0, 0], [0, -1, 0]], [0.0, 0.0, 0.0])  # T_body_camera, optical axes
TILT = se3.transform(se3.rotation_z(0.6) @ CAMERA[:3, :3] @ se3.rotation_z(0.3), [0.2, 0.1, 0.4])


def changed(trajectory, T=None, t_ns=None):
    new_t = trajectory.t_ns if t_ns is None else t_ns
    return Trajectory(new_t, trajectory.T_world_frame if T is None else T)


def reordered(trajectory):
    """As a file with w first reads where w is taken to come last."""
    q = se3.to_quaternion(trajectory.T_world_frame[:, :3, :3])[:, [3, 0, 1, 2]]
    return changed(trajectory, se3.transform(se3.from_quaternion(q), trajectory.positions_m))


def scaled(trajectory, factor):
    R = trajectory.T_world_frame[:, :3, :3]
    return changed(trajectory, se3.transform(R, factor * trajectory.positions_m))


def moved(word):
    return lambda est: changed(est, parse_pose_convention(word).apply(est.T_world_frame))


FRAMES = {
    "quaternion_order": [reordered],
    "axis_swap": [moved("axes:z,-x,-y"), moved("positions:y,x,z"), moved("positions:y,z,x"), moved("axes:y,x,z")],
    "mirrored_axes": [moved("positions:x,-y,z"), moved("positions:-x,y,z"), moved("axes:x,y,-z")],
    "inverse_poses": [moved("inverse")],
    "inverse_rotations": [moved("rotations:inverse")],
    "body_frame_offset": [lambda est: est.of_mounted(CAMERA), lambda est: est.of_mounted(TILT)],
    "scale": [lambda est: scaled(est, 0.5), lambda est: scaled(est, 1000.0)],
}
CLOCKS = {
    "time_offset": [
        lambda est: changed(est, t_ns=est.t_ns + 250_000_000),
        lambda est: changed(est, t_ns=est.t_ns - int(est.t_ns[0]) + 10**12),
    ],
    "stamp_unit": [lambda est: changed(est, t_ns=(est.t_ns - est.t_ns[0]) * 1000)],
}
PLAIN = [(fault, i) for fault, makers in FRAMES.items() for i in range(len(makers))]
ALL = [*PLAIN, *((fault, i) for fault, makers in CLOCKS.items() for i in range(len(makers)))]


def read(name):
    parsed = parse_any((DATA / name).read_text(), name=name)
    t_ns = parsed.t_ns
    if t_ns is None and "KITTI" in name:
        t_ns = parse_times((DATA / "KITTI_00_gt_times.txt").read_text(), name="times")
    unit = None if t_ns is None else "s"
    t_ns = np.arange(len(parsed.T)) * 10**9 if t_ns is None else t_ns
    return TrajectoryReading(Trajectory(t_ns, parsed.T), unit, unit)


@pytest.fixture(scope="module")
def real():
    return {
        "tum": (read("freiburg1_xyz-groundtruth.txt"), read("freiburg1_xyz-rgbdslam.txt")),
        "kitti": (read("KITTI_00_gt.txt"), read("KITTI_00_ORB.txt")),
        "tartanair": (read("tartanair/pose_gt.txt"), read("tartanair/pose_est.txt")),
    }


def loop(n=400, seed=1):
    """A drive with hills and turns at 20 Hz, and what a good estimator makes of it: its noise grows like a walk."""
    rng = np.random.default_rng(seed)
    s = np.linspace(0, 6, n)
    s = s + 0.1 * np.sin(9 * s)
    p = np.stack([5 * np.cos(s), 4 * np.sin(2 * s), 0.7 * np.sin(2.5 * s)], -1)
    axes = CAMERA[:3, :3]
    R = se3.rotation_z(s + np.pi / 2) @ axes @ se3.rotation_z(0.4 * np.sin(3 * s)) @ axes.T  # heading, roll
    gt = Trajectory(np.arange(n, dtype=np.int64) * 50_000_000, se3.transform(R, p))
    noisy = se3.transform(gt.T_world_frame[:, :3, :3], p + np.cumsum(rng.normal(scale=2e-3, size=p.shape), axis=0))
    return TrajectoryReading(gt), TrajectoryReading(Trajectory(gt.t_ns, noisy))


def assert_named(fault, gt, est):
    findings = diagnose(gt, est)
    assert [finding.fault for finding in findings] == [fault]
    (finding,) = findings
    assert finding.evidence
    assert all(np.isfinite(e.after) and (e.before is None or np.isfinite(e.before)) for e in finding.evidence)
    return finding


@pytest.mark.parametrize(("fault", "variant"), ALL)
def test_a_fault_of_a_made_up_drive_is_named(fault, variant):
    gt, est = loop()
    broken = (FRAMES | CLOCKS)[fault][variant](est.trajectory)
    assert_named(fault, gt, replace(est, trajectory=broken))


def test_a_clean_drive_has_no_fault_however_noisy():
    gt, est = loop()
    assert diagnose(gt, est) == ()
    assert diagnose(gt, gt) == ()
    rng = np.random.default_rng(0)
    shaken = est.trajectory.T_world_frame.copy()
    shaken[:, :3, 3] += rng.normal(scale=0.1, size=(len(shaken), 3))
    assert diagnose(gt, replace(est, trajectory=changed(est.trajectory, shaken))) == ()


def test_another_world_is_no_fault():
    gt, est = loop()
    elsewhere = TILT @ est.trajectory.T_world_frame
    assert diagnose(gt, replace(est, trajectory=changed(est.trajectory, elsewhere))) == ()


def test_several_faults_are_named_one_after_the_other():
    gt, est = loop()
    broken = scaled(est.trajectory, 3.0)
    broken = changed(
        broken, parse_pose_convention("axes:z,-x,-y").apply(broken.T_world_frame), broken.t_ns + 700_000_000
    )
    findings = diagnose(gt, replace(est, trajectory=broken))
    assert [finding.fault for finding in findings] == ["time_offset", "axis_swap", "scale"]
    assert [finding.options for finding in findings] == [
        ("--t-offset=-0.7",),
        ("--est-as", "axes:-y,-z,x"),
        ("-a", "sim3"),
    ]


def test_the_move_that_mends_is_the_inverse_of_the_one_that_broke():
    gt, est = loop()
    for word in ("axes:z,-x,-y", "positions:y,z,x"):  # neither is its own inverse
        broken = moved(word)(est.trajectory)
        finding = diagnose(gt, replace(est, trajectory=broken))[0]
        mended = parse_pose_convention(finding.options[1]).apply(broken.T_world_frame)
        np.testing.assert_allclose(mended, est.trajectory.T_world_frame, atol=1e-12)


def test_a_mount_that_mends_is_the_inverse_of_the_one_that_broke():
    gt, est = loop()
    finding = assert_named("body_frame_offset", gt, replace(est, trajectory=est.trajectory.of_mounted(TILT)))
    left = TILT @ parse_pose_convention(finding.options[1]).matrix
    assert np.rad2deg(se3.rotation_angle(left[:3, :3])) < 2
    assert np.linalg.norm(left[:3, 3]) < 0.05


def test_the_offset_that_mends_is_exact_where_stamps_meet():
    gt, est = loop()
    late = changed(est.trajectory, t_ns=est.trajectory.t_ns + 330_000_007)
    assert assert_named("time_offset", gt, replace(est, trajectory=late)).options == ("--t-offset=-0.330000007",)


def test_quaternions_of_either_side_may_be_in_the_wrong_order():
    gt, est = loop()
    finding = assert_named("quaternion_order", replace(gt, trajectory=reordered(gt.trajectory)), est)
    assert finding.options == ("--gt-as", "wxyz")
    read_first = replace(est, trajectory=reordered(est.trajectory))
    assert diagnose(gt, read_first)[0].options == ("--est-as", "wxyz")


def test_files_of_matrices_have_no_quaternion_order():
    gt, est = loop()
    broken = replace(est, trajectory=reordered(est.trajectory), order=None)
    assert all(finding.fault != "quaternion_order" for finding in diagnose(replace(gt, order=None), broken))


def test_stamps_that_could_only_be_read_in_another_unit_are_a_fault():
    gt, est = loop()
    finding = assert_named("stamp_unit", gt, replace(est, unit="ns"))
    assert finding.options == ("--est-as", "ns")
    assert finding.evidence[0].before == pytest.approx(1e9)
    assert finding.evidence[0].after == pytest.approx(1.0)


def test_a_truth_in_another_unit_is_told_from_an_estimate_in_one():
    gt, est = loop()
    slow = replace(gt, trajectory=changed(gt.trajectory, t_ns=gt.trajectory.t_ns * 1000))
    assert assert_named("stamp_unit", slow, est).options == ("--gt-as", "ms")


@pytest.mark.parametrize("shape", ["line", "still", "plane"])
def test_poor_motion_is_no_fault(shape):
    n = 100
    s = np.linspace(0, 1, n)
    p = np.zeros((n, 3)) if shape == "still" else np.stack([10 * s, 3 * s, s], -1)
    if shape == "plane":
        p = np.stack([5 * np.cos(6 * s), 5 * np.sin(6 * s), 0 * s], -1)
    R = se3.rotation_z(6 * s) if shape == "plane" else np.broadcast_to(np.eye(3), (n, 3, 3))
    gt = Trajectory(np.arange(n) * 10**8, se3.transform(R, p))
    noise = np.random.default_rng(2).normal(scale=1e-3, size=(n, 3))
    assert diagnose(TrajectoryReading(gt), TrajectoryReading(changed(gt, se3.transform(R, p + noise)))) == ()


@pytest.mark.parametrize("word", ["inverse", "rotations:inverse"])
def test_inverses_are_known_in_any_world_and_on_either_side(word):
    gt, est = loop()
    elsewhere = TILT @ est.trajectory.T_world_frame
    est = replace(est, trajectory=changed(est.trajectory, elsewhere))
    for side, given in (
        ("est", (gt, replace(est, trajectory=moved(word)(est.trajectory)))),
        ("gt", (replace(gt, trajectory=moved(word)(gt.trajectory)), est)),
    ):
        (finding,) = diagnose(*given)
        assert (finding.fault, finding.options) == (
            {"inverse": "inverse_poses", "rotations:inverse": "inverse_rotations"}[word],
            (f"--{side}-as", word),
        )


@WITH_DATA
@pytest.mark.parametrize(
    ("name", "word"),
    [("tum", "rotations:inverse"), ("kitti", "inverse"), ("kitti", "rotations:inverse"), ("tartanair", "inverse")],
)
def test_inverses_of_real_estimates_are_mended_on_the_estimates_side(real, name, word):
    gt, est = real[name]
    finding = diagnose(gt, replace(est, trajectory=moved(word)(est.trajectory)))[0]
    assert finding.options == ("--est-as", word)


@pytest.mark.parametrize(("seed", "factor"), [(0, 1e-3), (1, 1.0), (2, 200.0), (3, 1.0), (4, 1e-3), (5, 200.0)])
def test_trajectories_with_nothing_in_common_are_called_so_and_nothing_else(seed, factor):
    rng = np.random.default_rng(seed)
    gt, _ = loop()
    s = np.linspace(0, 6, 400)
    waves = np.sin(rng.uniform(0.5, 4, (3, 5, 1)) * s + rng.uniform(0, 6, (3, 5, 1))).sum(axis=1).T
    other = Trajectory(gt.trajectory.t_ns, se3.transform(se3.rotation_z(waves[:, 0]), factor * waves))
    finding = assert_named("unrelated", gt, TrajectoryReading(other))
    assert finding.options == ()
    assert finding.evidence[0].after >= 50


def test_an_estimate_that_is_merely_bad_is_not_called_unrelated():
    gt, est = loop()
    drifted = est.trajectory.T_world_frame.copy()
    drifted[:, :3, 3] += np.linspace(0, 5, len(drifted))[:, None] * [0.5, 0.3, 0.2]
    assert "unrelated" not in [f.fault for f in diagnose(gt, replace(est, trajectory=changed(est.trajectory, drifted)))]


def test_a_unit_and_an_order_that_were_told_are_believed():
    gt, est = loop()
    assert diagnose(replace(gt, unit="ns", format_unit="ns", is_unit_given=True), est) == ()
    slow = replace(gt, trajectory=changed(gt.trajectory, t_ns=gt.trajectory.t_ns * 1000))
    assert diagnose(slow, est)[0].fault == "stamp_unit"
    with pytest.raises(AlignmentError, match="1 match"):
        diagnose(replace(slow, is_unit_given=True), est)
    told = replace(est, trajectory=reordered(est.trajectory), order=None)
    assert "quaternion_order" not in [finding.fault for finding in diagnose(replace(gt, order=None), told)]


@pytest.mark.parametrize(("offset_ns", "noise_m"), [(-60_000_000, 0.0), (-40_000_000, 5e-3), (40_000_000, 5e-3)])
def test_a_clock_about_a_frame_off_is_found_where_speeds_change(offset_ns, noise_m):
    gt, est = loop()
    T = est.trajectory.T_world_frame.copy()
    T[:, :3, 3] += noise_m * np.random.default_rng(4).normal(size=(len(T), 3))
    shifted = changed(est.trajectory, T, est.trajectory.t_ns + offset_ns)
    finding = assert_named("time_offset", gt, replace(est, trajectory=shifted))
    assert float(finding.options[0].partition("=")[2]) == pytest.approx(-offset_ns / 1e9, abs=0.01)


def test_too_little_to_compare_is_an_error():
    gt, est = loop()
    few = Trajectory(gt.trajectory.t_ns[:3], gt.trajectory.T_world_frame[:3])
    assert len(few) == 3
    with pytest.raises(AlignmentError, match="a diagnosis needs 8 matched poses or more, but 3 match"):
        diagnose(gt, replace(est, trajectory=few))


@WITH_DATA
@pytest.mark.parametrize("name", ["tum", "kitti", "tartanair"])
def test_real_pairs_have_no_fault(real, name):
    assert diagnose(*real[name]) == ()


@WITH_DATA
@pytest.mark.parametrize("name", ["tum", "kitti", "tartanair"])
def test_real_pairs_given_in_the_wrong_order_are_named(real, name):
    gt, est = real[name]
    assert_named("swapped_inputs", est, gt)


@WITH_DATA
@pytest.mark.parametrize(("fault", "name"), list(zip(FRAMES, ["tum", "kitti", "tartanair"] * 3, strict=False)))
def test_a_fault_of_frames_put_into_a_real_pair_is_named(real, name, fault):
    gt, est = (replace(reading, unit=None) for reading in real[name])
    assert_named(fault, gt, replace(est, trajectory=FRAMES[fault][-1](est.trajectory)))


@WITH_DATA
@pytest.mark.parametrize("name", ["tum", "kitti"])
@pytest.mark.parametrize("fault", CLOCKS)
def test_a_fault_of_clocks_put_into_a_real_pair_is_named(real, name, fault):
    gt, est = real[name]
    broken = replace(est, trajectory=CLOCKS[fault][0](est.trajectory))
    faults = [finding.fault for finding in diagnose(gt, broken)]
    assert faults[0] == fault
    assert set(faults) <= set(CLOCKS)


@WITH_DATA
@pytest.mark.parametrize(("name", "offset_ns"), [("tum", 50_000_000), ("tum", -50_000_000), ("kitti", 50_000_000)])
def test_a_clock_of_a_real_pair_may_be_a_twentieth_of_a_second_off(real, name, offset_ns):
    gt, est = real[name]
    late = changed(est.trajectory, t_ns=est.trajectory.t_ns + offset_ns)
    finding = assert_named("time_offset", gt, replace(est, trajectory=late))
    own_ns = 10_400_000 if name == "tum" else 0  # fr1/xyz came with an offset
    assert float(finding.options[0].partition("=")[2]) * 1e9 == pytest.approx(-offset_ns - own_ns, abs=1e6)


@WITH_DATA
@pytest.mark.parametrize(("one", "other"), [("tum", "kitti"), ("kitti", "tartanair"), ("tartanair", "tum")])
def test_real_trajectories_of_other_places_are_not_of_one_motion(real, one, other):
    gt, est = real[one][0].trajectory, real[other][1].trajectory
    n = min(len(gt), len(est))
    t_ns = np.arange(n) * 10**8
    pair = (TrajectoryReading(Trajectory(t_ns, t.T_world_frame[:n])) for t in (gt, est))
    assert_named("unrelated", *pair)


@WITH_DATA
def test_a_monocular_path_is_known_by_its_scale(real):
    gt, est = real["tum"][0], read("freiburg1_xyz-ORB_kf_mono.txt")
    assert_named("scale", gt, est)


# --- Limits, on drives that were made up ---


def with_positions(reading, positions_m):
    T = reading.trajectory.T_world_frame.copy()
    T[:, :3, 3] = positions_m
    return replace(reading, trajectory=changed(reading.trajectory, T))


def test_the_figures_of_an_offset_are_correlations_and_its_sentence_says_behind_or_ahead():
    gt, est = loop()
    for offset_ns, word in ((-250_000_000, "behind"), (250_000_000, "ahead")):
        shifted = replace(est, trajectory=changed(est.trajectory, t_ns=est.trajectory.t_ns + offset_ns))
        finding = assert_named("time_offset", gt, shifted)
        assert finding.sentence == f"the estimate's clock is 0.250 s {word}"
        (evidence,) = finding.evidence
        assert evidence.before < evidence.after <= 1


@pytest.mark.parametrize("factor", [0.25, 2.0, 1.03])
def test_a_scale_is_stated_as_how_many_times_larger_the_estimate_is(factor):
    gt, _ = loop()
    finding = assert_named("scale", gt, replace(gt, trajectory=scaled(gt.trajectory, factor)))
    assert finding.sentence == f"the estimate is {factor:.4g} times as large as the truth"
    (evidence,) = finding.evidence
    from_middle_m = gt.trajectory.positions_m - gt.trajectory.positions_m.mean(0)
    rms_m = np.sqrt((from_middle_m**2).sum(1).mean())
    assert evidence.before == pytest.approx(abs(factor - 1) * rms_m, rel=1e-3)
    assert evidence.after == pytest.approx(0, abs=1e-6)


def test_a_scale_of_1_percent_or_one_that_explains_little_is_no_fault():
    gt, est = loop()
    assert diagnose(gt, replace(gt, trajectory=scaled(gt.trajectory, 1.01))) == ()
    rng = np.random.default_rng(0)
    noisy = scaled(gt.trajectory, 1.03).positions_m + rng.normal(0, 0.3, (len(gt.trajectory), 3))
    assert diagnose(gt, with_positions(est, noisy)) == ()


def test_the_evidence_of_a_fault_of_frames_is_in_degrees_and_percent_of_the_extent():
    gt, est = loop()
    broken = replace(est, trajectory=est.trajectory.of_mounted(TILT))
    finding = assert_named("body_frame_offset", gt, broken)
    rotation, position, motions = finding.evidence
    assert [e.unit for e in finding.evidence] == ["deg", "%", "m"]
    # The mean rotation between both frames is in the world's alignment, too, so less than its angle is left before.
    assert rotation.after < 1 < rotation.before < np.rad2deg(float(se3.rotation_angle(TILT[:3, :3]))) + 1
    assert position.after < 2 < position.before < 20
    assert motions.after < motions.before
    angle_deg = np.rad2deg(float(se3.rotation_angle(TILT[:3, :3])))
    assert f"rotated by {angle_deg:.1f} deg and 0.4" in finding.sentence


@pytest.mark.parametrize(
    ("word", "sentence"),
    [
        ("inverse", "the estimate's poses are inverse"),
        ("rotations:inverse", "the estimate's rotations are inverse"),
        ("positions:x,-y,z", "positions, but not its rotations, are mirrored: the truth's x,y,z are its x,-y,z"),
        ("positions:y,z,x", "positions, but not its rotations, are swapped: the truth's x,y,z are its z,x,y"),
        ("axes:x,y,-z", "positions and rotations are mirrored: the truth's x,y,z are its x,y,-z"),
    ],
)
def test_the_sentence_says_what_is_wrong_and_the_option_corrects_it(word, sentence):
    gt, est = loop()
    broken = replace(est, trajectory=moved(word)(est.trajectory))
    (finding,) = diagnose(gt, broken)
    assert sentence in finding.sentence
    _, option = finding.options
    corrected = replace(est, trajectory=moved(option)(broken.trajectory))
    assert diagnose(gt, corrected) == ()


@pytest.mark.parametrize(("as_read", "right"), [("xyzw", "wxyz"), ("wxyz", "xyzw")])
@pytest.mark.parametrize("side", ["gt", "est"])
def test_the_right_order_of_quaternions_is_named_for_either_side(side, as_read, right):
    gt, est = loop()
    readings = {"gt": replace(gt, order=as_read), "est": replace(est, order=as_read)}
    q = se3.to_quaternion(readings[side].trajectory.T_world_frame[:, :3, :3])
    columns = [3, 0, 1, 2] if as_read == "xyzw" else [1, 2, 3, 0]
    R = se3.from_quaternion(q[:, columns])
    misread = changed(readings[side].trajectory, se3.transform(R, readings[side].trajectory.positions_m))
    readings[side] = replace(readings[side], trajectory=misread)
    (finding,) = diagnose(readings["gt"], readings["est"])
    name = {"gt": "ground truth", "est": "estimate"}[side]
    assert finding.sentence == f"the {name}'s quaternions are {right}"
    assert finding.options == (f"--{side}-as", right)


# --- Units ---


@pytest.mark.parametrize(("factor", "right"), [(10**3, "ms"), (10**6, "us"), (10**9, "ns")])
def test_stamps_in_any_finer_unit_are_known_by_the_duration(factor, right):
    gt, est = loop()
    t_ns = (est.trajectory.t_ns - est.trajectory.t_ns[0]) // 10**6 * 10**6  # as far as int64 reaches
    if factor == 10**9:
        t_ns = t_ns // 10**4
        gt = replace(gt, trajectory=changed(gt.trajectory, t_ns=gt.trajectory.t_ns // 10**4))
    finding = diagnose(gt, replace(est, trajectory=changed(est.trajectory, t_ns=t_ns * factor)))[0]
    assert (finding.fault, finding.options) == ("stamp_unit", ("--est-as", right))
    (evidence,) = finding.evidence
    assert evidence.name == "duration over that of the ground truth"
    assert (evidence.before, evidence.after) == pytest.approx((factor, 1.0), rel=1e-6)


def test_a_recording_that_is_merely_longer_or_sparser_has_no_wrong_unit():
    gt, est = loop()
    for step in (1, 40):
        chosen = slice(None, None, step)
        sparse = Trajectory(est.trajectory.t_ns[chosen] * (1 if step > 1 else 20), est.trajectory.T_world_frame[chosen])
        try:
            faults = [finding.fault for finding in diagnose(gt, replace(est, trajectory=sparse))]
        except AlignmentError:
            faults = []
        assert "stamp_unit" not in faults


# --- Swapped inputs ---


def tracked_and_estimated():
    """A smooth estimate at 20 Hz, and a noisy truth at 100 Hz of the same drive, in each other's place."""
    gt, _ = loop(n=2000)
    fine = replace(gt, trajectory=changed(gt.trajectory, t_ns=gt.trajectory.t_ns // 5))
    coarse = Trajectory(fine.trajectory.t_ns[::5], fine.trajectory.T_world_frame[::5])
    noise_m = np.random.default_rng(3).normal(0, 2e-4, (len(coarse), 3))
    return with_positions(replace(gt, trajectory=coarse), coarse.positions_m + noise_m), fine


def faults(gt, est):
    return [finding.fault for finding in diagnose(gt, est)]


def test_a_truth_that_is_sparser_and_noisier_than_the_estimate_is_the_estimate():
    gt, est = tracked_and_estimated()
    noisy = with_positions(gt, gt.trajectory.positions_m + np.random.default_rng(5).normal(0, 3e-3, (400, 3)))
    est = with_positions(est, est.trajectory.positions_m + np.random.default_rng(6).normal(0, 1e-5, (2000, 3)))
    finding = assert_named("swapped_inputs", noisy, est)
    assert finding.sentence == "ground truth and estimate seem to be exchanged"
    noise, rate = finding.evidence
    assert noise.before > 1.5
    assert noise.before * noise.after == pytest.approx(1)
    assert (rate.before, rate.after) == pytest.approx((0.2, 5.0))
    assert "swapped_inputs" not in faults(est, noisy)


def test_names_and_an_origin_are_signs_too_and_one_of_them_alone_is_not_enough():
    gt, est = loop()
    at_origin = se3.inverse(gt.trajectory.T_world_frame[0])
    rng = np.random.default_rng(1)
    noisy = with_positions(est, est.trajectory.positions_m + rng.normal(0, 1e-5, (400, 3)))
    begins = replace(gt, trajectory=changed(gt.trajectory, at_origin @ gt.trajectory.T_world_frame))
    assert faults(begins, noisy) == []
    assert faults(gt, replace(noisy, mentions_ground_truth=True)) == []
    finding = assert_named("swapped_inputs", begins, replace(noisy, mentions_ground_truth=True))
    assert finding.sentence == (
        "ground truth and estimate seem to be exchanged; the truth begins at the identity and the estimate does not; "
        "the estimate's file calls itself ground truth"
    )
    # Both that say so, or neither, are no sign.
    assert faults(replace(begins, mentions_ground_truth=True), replace(noisy, mentions_ground_truth=True)) == []
    # Signs against it weigh as much as those for it.
    assert faults(replace(begins, mentions_ground_truth=True), noisy) == []


@pytest.mark.parametrize(("step", "is_sign"), [(3, True), (1, False)])
def test_more_than_twice_the_rate_is_a_sign_of_a_tracker(step, is_sign):
    gt, _ = loop(n=1200)
    rng = np.random.default_rng(1)
    est = with_positions(gt, gt.trajectory.positions_m + rng.normal(0, 1e-6, (1200, 3)))
    sparse = Trajectory(gt.trajectory.t_ns[::step], gt.trajectory.T_world_frame[::step])
    given = (replace(gt, trajectory=sparse), replace(est, mentions_ground_truth=True))
    assert faults(*given) == (["swapped_inputs"] if is_sign else [])
    if is_sign:  # the same rates the other way round are a sign against it
        begins = se3.inverse(est.trajectory.T_world_frame[0]) @ est.trajectory.T_world_frame
        fine = replace(gt, trajectory=changed(est.trajectory, begins))
        assert faults(fine, replace(gt, trajectory=sparse, mentions_ground_truth=True)) == []


@pytest.mark.parametrize(("sigma_m", "is_sign"), [(3e-4, True), (1e-6, False)])
def test_noise_is_a_sign_only_where_it_is_more_than_motion(sigma_m, is_sign):
    gt, _ = loop(n=1200)
    rng = np.random.default_rng(1)
    noisy = with_positions(gt, gt.trajectory.positions_m + rng.normal(0, sigma_m, (1200, 3)))
    smooth = with_positions(gt, gt.trajectory.positions_m + rng.normal(0, sigma_m / 1.7, (1200, 3)))
    # Noise 1.7 times as large is one sign, and the name of the file another.
    assert faults(noisy, replace(smooth, mentions_ground_truth=True)) == (["swapped_inputs"] if is_sign else [])
    smoother = with_positions(gt, gt.trajectory.positions_m + rng.normal(0, sigma_m / 2.5, (1200, 3)))
    # Noise 2.5 times as large at the same instants is two signs.
    assert faults(noisy, smoother) == (["swapped_inputs"] if is_sign else [])
    few = Trajectory(smoother.trajectory.t_ns[:-1], smoother.trajectory.T_world_frame[:-1])
    assert faults(noisy, replace(smoother, trajectory=few)) == []


def test_an_offset_is_a_clear_gain_if_a_quarter_of_the_missing_correlation_or_more_is_gone():
    assert _is_clear_gain(0.9, 0.93)
    assert not _is_clear_gain(0.9, 0.92)
    assert not _is_clear_gain(0.9, 0.9)
    assert not _is_clear_gain(1.0, 1.0)
    assert not _is_clear_gain(0.9999, 1.0)  # a gain too small to mean anything
    assert _is_clear_gain(None, 0.5)  # without the offset there was no overlap


@pytest.mark.parametrize(
    ("misfit_after", "disagreement", "is_unrelated"),
    [
        (0.01, 0.05, False),
        (0.01, 0.2, False),  # noisy motions along a path that fits
        (0.05, 0.05, False),  # a path that drifts
        (0.05, 0.2, True),
        (0.01, 0.4, True),  # motions of another drive along the same path
        (0.9, 0.05, True),
        (0.9, None, True),
        (0.05, None, False),
    ],
)
def test_pairs_are_unrelated_by_their_positions_by_their_motions_or_by_a_doubt_about_both(
    misfit_after, disagreement, is_unrelated
):
    assert _is_unrelated(misfit_after, disagreement) is is_unrelated


def test_what_is_left_of_unrelated_positions_is_in_percent_before_and_after():
    (positions,) = _unrelated(0.8, 0.5, None).evidence
    assert (positions.unit, positions.before, positions.after) == ("%", 80, 50)
    positions, motions = _unrelated(0.8, 0.5, 0.9).evidence
    assert (motions.unit, motions.before, motions.after) == ("1", None, 0.9)


def test_positions_that_do_not_correlate_have_no_scale():
    along = np.array([1.0, -1.0, -1.0, 1.0])
    at_other_times = np.array([1.0, 1.0, -1.0, -1.0])
    T_gt, T_est = (se3.transform(np.eye(3), np.stack([x, 0 * x, 0 * x], axis=-1)) for x in (along, 10 * at_other_times))
    assert list(_wrong_scale(T_gt, T_est)) == []
    tenfold = T_gt.copy()
    tenfold[:, :3, 3] *= 10
    assert [finding.fault for finding in _wrong_scale(T_gt, tenfold)] == ["scale"]


def test_a_clock_that_is_late_is_found_behind_inverse_poses():
    gt, est = (replace(reading, unit="s", format_unit="s") for reading in loop())
    inverse_and_late = changed(moved("inverse")(est.trajectory), t_ns=est.trajectory.t_ns + 400_000_000)
    findings = diagnose(gt, replace(est, trajectory=inverse_and_late))
    assert [finding.fault for finding in findings] == ["inverse_poses", "time_offset"]
    assert float(findings[1].options[0].partition("=")[2]) == pytest.approx(-0.4, abs=0.01)


def test_poses_in_reversed_order_are_unrelated_whatever_offset_of_the_clocks_fits_best():
    for seed in range(5):
        gt, est = (replace(reading, unit="s", format_unit="s") for reading in loop(seed=seed))
        backwards = changed(est.trajectory, est.trajectory.T_world_frame[::-1])
        assert_named("unrelated", gt, replace(est, trajectory=backwards))


def test_a_half_turn_of_the_axes_is_no_mirror_image():
    gt, est = loop()
    finding = assert_named("axis_swap", gt, replace(est, trajectory=moved("axes:x,-y,-z")(est.trajectory)))
    assert "turned by half a turn" in finding.sentence


def test_an_error_of_positions_along_a_straight_road_is_not_taken_for_another_frame_of_the_body():
    rng = np.random.default_rng(3)
    n = 500
    sway = np.cumsum(rng.normal(scale=0.02, size=n))
    positions_m = np.stack([np.linspace(0, 450, n), 60 * np.linspace(-1, 1, n) ** 2, sway], axis=-1)
    gt = Trajectory(np.arange(n, dtype=np.int64) * 10**8, se3.transform(np.eye(3), positions_m))
    bend_m = np.stack([np.zeros(n), np.zeros(n), 8 * np.cos(2.2 * np.linspace(-1, 1, n)) ** 3], axis=-1)
    est = changed(gt, se3.transform(np.eye(3), positions_m + bend_m))
    assert diagnose(TrajectoryReading(gt), TrajectoryReading(est)) == ()
