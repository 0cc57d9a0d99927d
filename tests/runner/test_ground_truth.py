"""Ground truths: known only near true poses, and noisy by draws that a window of frames does not change."""

import numpy as np
import pytest

from vobench.geometry import se3
from vobench.runner.frames import EXPOSURES, GROUND_TRUTH, read_table
from vobench.runner.ground_truth import LONGEST_GAP_NS, is_known, left_truth, noisy, write_ground_truth
from vobench.sequence import Sequence, read_truth
from vobench.suite.suite_spec import EXACT, TruthNoise
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import format_tum, parse_tum

N = 400


def truth(n: int = N) -> Trajectory:
    rng = np.random.default_rng(1)
    T = np.stack(
        [se3.transform(se3.rotation_z(a), p) for a, p in zip(rng.normal(size=n), rng.normal(size=(n, 3)), strict=True)]
    )
    return Trajectory(np.arange(n, dtype=np.int64) * 10**8, T)


def noise_of(text: str, exact: Trajectory) -> tuple[np.ndarray, np.ndarray]:
    """Translations (N, 3) and rotation angles (N,) of the noise, in the true frames."""
    error = se3.inverse(exact.T_world_frame) @ parse_tum(text, name="x").T_world_frame
    return error[:, :3, 3], se3.rotation_angle(error[:, :3, :3])


def test_noise_has_the_deviations_of_its_settings_in_every_axis():
    text = format_tum(truth())
    moved_m, turned_rad = noise_of(
        noisy(text, TruthNoise(position_m=0.02, rotation_deg=0.5), seed=3, frames=None), truth()
    )
    np.testing.assert_allclose(moved_m.std(axis=0), 0.02, rtol=0.15)
    np.testing.assert_allclose(moved_m.mean(axis=0), 0, atol=0.004)
    assert np.sqrt(np.mean(turned_rad**2)) == pytest.approx(np.sqrt(3) * np.deg2rad(0.5), rel=0.1)


def test_position_and_rotation_have_draws_of_their_own():
    text = format_tum(truth())
    moved_m, turned_rad = noise_of(
        noisy(text, TruthNoise(position_m=0.02, rotation_deg=0.0), seed=3, frames=None), truth()
    )
    assert np.abs(moved_m).max() > 0.02
    assert turned_rad.max() < 1e-6


def test_a_window_of_frames_has_the_noise_that_it_has_in_the_whole_case():
    whole = truth()
    noise = TruthNoise(position_m=0.02, rotation_deg=0.5)
    all_frames = parse_tum(noisy(format_tum(whole), noise, seed=3, frames=None), name="x")
    window = Trajectory(whole.t_ns[100:150], whole.T_world_frame[100:150])
    cut = parse_tum(noisy(format_tum(window), noise, seed=3, frames=(100, 150)), name="x")
    np.testing.assert_array_equal(cut.T_world_frame, all_frames.T_world_frame[100:150])


def test_equal_seeds_give_equal_noise_and_others_other_noise():
    text = format_tum(truth(5))
    noise = TruthNoise(position_m=0.02, rotation_deg=0.5)
    assert noisy(text, noise, seed=3, frames=None) == noisy(text, noise, seed=3, frames=None)
    assert noisy(text, noise, seed=3, frames=None) != noisy(text, noise, seed=4, frames=None)
    assert noisy(text, EXACT, seed=3, frames=None) == text


def test_stamps_are_known_on_true_poses_and_between_near_ones():
    gap_ns = LONGEST_GAP_NS
    true_ns = np.array([10, 10 + gap_ns, 11 + 2 * gap_ns], np.int64)  # the second gap is 1 ns too long
    stamps = {
        9: False,
        10: True,
        11: True,
        10 + gap_ns - 1: True,
        10 + gap_ns: True,
        11 + gap_ns: False,
        10 + 2 * gap_ns: False,
        11 + 2 * gap_ns: True,
        12 + 2 * gap_ns: False,
    }
    assert is_known(true_ns, np.array(list(stamps), np.int64)).tolist() == list(stamps.values())


@pytest.mark.slow
def test_the_files_beside_a_sequence_have_a_pose_and_an_exposure_for_each_frame(first, tmp_path):
    sequence = next((first.path / "cases").glob("*/sequence")).resolve()
    for name in ("truth.mcap", "sensors.mcap"):
        (tmp_path / name).symlink_to(sequence / name)
    write_ground_truth(tmp_path)
    rig = Sequence.open(sequence).rig
    body = read_truth(sequence)
    left = parse_tum((tmp_path / GROUND_TRUTH).read_text(), name="x")
    rows = read_table(tmp_path / EXPOSURES)
    np.testing.assert_allclose(left.T_world_frame, body.T_world_frame @ rig.T_body_left, atol=1e-8)
    np.testing.assert_array_equal(left_truth(sequence).t_ns, body.t_ns)
    assert [int(row["t_ns"]) for row in rows] == body.t_ns.tolist()
    assert [int(row["frame"]) for row in rows] == list(range(len(body.t_ns)))
    assert {float(row["exposure_s"]) > 0 for row in rows} == {True}
    assert (tmp_path / GROUND_TRUTH).read_bytes() == (sequence / GROUND_TRUTH).read_bytes()
