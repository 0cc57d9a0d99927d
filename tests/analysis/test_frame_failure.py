"""Failing frames, the worst part of a recording, and the errors of two trials in time."""

import numpy as np
import pytest
import scipy

from vobench.analysis.frame_failure import coincidence, failing_loss, frame_losses, twin_coincidence, worst_window
from vobench.analysis.recording_explanation import TRUSTED_OVERLAP, TRUSTED_P
from vobench.geometry import se3
from vobench.trajectory.trajectory import Trajectory


def straight(step_m: np.ndarray) -> Trajectory:
    """A straight path at 10 Hz with steps (N - 1,) in m."""
    along_m = np.concatenate([[0.0], np.cumsum(step_m)])
    positions_m = np.stack([along_m, 0 * along_m, 0 * along_m], 1)
    t_ns = (np.arange(len(along_m)) * 10**8).astype(np.int64)
    return Trajectory(t_ns, se3.transform(np.eye(3), positions_m))


def test_the_truth_has_no_error_wherever_it_starts() -> None:
    gt = straight(np.full(50, 0.1))
    moved = Trajectory(gt.t_ns, se3.transform(se3.rotation_z(0.7), np.array([1.0, 2.0, 3.0])) @ gt.T_world_frame)
    assert frame_losses(gt, moved) == pytest.approx(0, abs=1e-9)


def test_wrong_steps_are_errors_of_the_frames_around_them() -> None:
    gt = straight(np.full(50, 0.1))
    steps_m = np.full(50, 0.1)
    steps_m[20:30] = 0.15  # from frame 20 to frame 30
    loss = frame_losses(gt, straight(steps_m))
    assert loss[22:29] == pytest.approx(0.5)
    assert (loss[[19, 20, 21, 29, 30, 31]] > 0.1).all()
    assert loss[:19] == pytest.approx(0, abs=1e-9)
    assert loss[32:] == pytest.approx(0, abs=1e-9)


def test_frames_without_a_pose_and_their_neighbours_have_the_whole_error() -> None:
    gt = straight(np.full(50, 0.1))
    has_pose = np.ones(51, bool)
    has_pose[10:14] = False
    loss = frame_losses(gt, Trajectory(gt.t_ns[has_pose], gt.T_world_frame[has_pose]))
    assert np.flatnonzero(loss == 1).tolist() == list(range(8, 16))
    assert (frame_losses(gt, Trajectory(gt.t_ns[:0], gt.T_world_frame[:0])) == 1).all()


def test_the_scale_multiplies_the_estimate() -> None:
    gt = straight(np.full(50, 0.1))
    half = straight(np.full(50, 0.05))
    assert frame_losses(gt, half)[2:-2] == pytest.approx(0.5)
    assert frame_losses(gt, half, scale=2.0) == pytest.approx(0, abs=1e-9)


def test_the_worst_part_has_the_large_errors_in_its_middle() -> None:
    t_ns = (np.arange(200) * 10**8).astype(np.int64)
    loss = np.full(200, 0.01)
    loss[70:100] = 0.5
    window = worst_window(t_ns, loss, 5.0)
    assert len(window) == 51
    assert window.first < 70 - 5
    assert window.end > 100 + 5


def test_a_gap_in_the_frames_does_not_hide_the_errors_around_it() -> None:
    t_ns = (np.arange(200) * 10**8).astype(np.int64)
    loss = np.full(200, 0.05)
    loss[70:100] = 0.5
    is_kept = np.ones(200, bool)
    is_kept[70:100] = np.arange(30) % 6 == 0
    window = worst_window(t_ns[is_kept], loss[is_kept], 5.0)
    first_ns = t_ns[is_kept][window.first]
    last_ns = t_ns[is_kept][window.end - 1]
    assert first_ns <= 7.0e9
    assert last_ns >= 9.9e9


def test_a_short_recording_is_the_worst_part_itself() -> None:
    t_ns = (np.arange(20) * 10**8).astype(np.int64)
    window = worst_window(t_ns, np.full(20, 0.1), 5.0)
    assert (window.first, window.end) == (0, 20)


@pytest.mark.parametrize(("typical", "limit"), [(0.0, 0.02), (0.01, 0.03), (0.1, 0.3), (0.9, 0.5)])
def test_a_frame_fails_by_its_error_relative_to_a_typical_one(typical: float, limit: float) -> None:
    assert failing_loss(typical) == pytest.approx(limit)


def test_a_failure_that_is_longer_than_the_part_is_shown_with_its_beginning_or_its_end() -> None:
    t_ns = (np.arange(300) * 10**8).astype(np.int64)
    loss = np.full(300, 0.01)
    loss[100:200] = 0.5
    window = worst_window(t_ns, loss, 5.0)
    is_large = loss[window.frames] > 0.1
    assert 0.75 < is_large.mean() < 0.85


def test_errors_that_are_large_throughout_have_a_worst_part_too() -> None:
    t_ns = (np.arange(100) * 10**8).astype(np.int64)
    assert len(worst_window(t_ns, np.full(100, 0.5), 5.0)) == 51


FRAMES = 50


def block(first: int, end: int, *, height: float = 1.0) -> np.ndarray:
    """An error that is large from one frame to before another."""
    errors = np.zeros(FRAMES)
    errors[first:end] = height
    return errors


def test_the_overlap_of_constant_errors_is_the_share_of_frames_in_both_of_those_in_either() -> None:
    assert coincidence(block(10, 30), block(15, 35)).overlap == pytest.approx(15 / 25)
    assert coincidence(block(10, 30), block(10, 30)).overlap == pytest.approx(1)
    assert coincidence(block(10, 30), block(30, 50)).overlap == 0


def test_the_overlap_does_not_depend_on_the_sizes_of_the_errors_nor_on_their_order() -> None:
    rng = np.random.default_rng(0)
    errors = rng.uniform(size=FRAMES) ** 3
    others = rng.uniform(size=FRAMES) ** 3
    found = coincidence(errors, others)
    assert coincidence(errors, 0.1 * others).overlap == pytest.approx(found.overlap)
    assert coincidence(others, errors).overlap == pytest.approx(found.overlap)
    assert coincidence(others, errors).p == pytest.approx(found.p)


def test_neither_a_large_nor_a_small_error_elsewhere_decides_alone() -> None:
    whole = block(5, 25)
    with_small_ones = whole + block(30, 45, height=0.05)
    assert coincidence(whole, with_small_ones).overlap > 0.9
    with_a_large_one = whole + block(10, 11, height=9.0)
    assert coincidence(whole, with_a_large_one).overlap > 0.7


def test_chance_is_what_rotations_of_one_error_in_time_reach() -> None:
    exact = coincidence(block(10, 30), block(10, 30))
    assert exact.p == pytest.approx(1 / FRAMES)
    two_late = coincidence(block(10, 30), block(12, 32))
    assert two_late.p == pytest.approx(5 / FRAMES)  # by -2 to 2 frames
    assert two_late.by_chance == pytest.approx(exact.by_chance)

    throughout = coincidence(block(0, FRAMES), block(0, FRAMES))
    assert (throughout.overlap, throughout.by_chance, throughout.p) == (pytest.approx(1), pytest.approx(1), 1)


def test_errors_at_independent_times_coincide_as_often_as_stated() -> None:
    rng = np.random.default_rng(1)
    p_values = []
    for _ in range(1000):
        spikes = rng.exponential(size=(2, FRAMES)) ** 2
        errors, others = scipy.ndimage.gaussian_filter1d(spikes, 2.0, axis=1, mode="wrap")
        p_values.append(coincidence(errors, others).p)
    assert np.mean(np.array(p_values) <= 0.1) == pytest.approx(0.1, abs=0.03)


def test_without_an_error_nothing_coincides() -> None:
    nothing = np.zeros(FRAMES)
    for found in (coincidence(nothing, block(0, 9)), coincidence(block(0, 9), nothing)):
        assert (found.overlap, found.p) == (0, 1)


# --- A recording and its twin ---

TWIN_TRIALS = 9
DAMAGED_FRAMES = 20


def trial(rng: np.random.Generator, difficulty: np.ndarray, *, begin: int | None, factor: float) -> np.ndarray:
    """Errors of one trial: noise that lasts for some frames, larger where the path is hard, and raised by damage.

    Damage of DAMAGED_FRAMES from a frame on raises the error by random factors about `factor`, at times by much more.
    """
    white = rng.normal(size=(3, FRAMES))
    lasting = 2 * scipy.ndimage.uniform_filter1d(white, 4, axis=1, mode="wrap")
    loss = 0.01 * difficulty * np.linalg.norm(lasting, axis=0)
    if begin is not None:
        factors = np.repeat(rng.lognormal(np.log(factor), 1.2, DAMAGED_FRAMES // 4), 4)
        loss[begin : begin + DAMAGED_FRAMES] *= np.maximum(factors, 1)
    return np.minimum(loss, 1)


def trusted_share(*, twin_begin: int, factor: float, hard_from: int = FRAMES) -> float:
    """The share of twins that are trusted if their damage begins at a frame, and that of the recording at frame 5."""
    rng = np.random.default_rng(3)
    difficulty = np.where(np.arange(FRAMES) >= hard_from, 4.0, 1.0)
    trusted = 0
    for _ in range(200):
        recorded = trial(rng, difficulty, begin=5, factor=factor)
        changed = [trial(rng, difficulty, begin=twin_begin, factor=factor) for _ in range(TWIN_TRIALS)]
        unchanged = [trial(rng, difficulty, begin=None, factor=factor) for _ in range(TWIN_TRIALS)]
        found = twin_coincidence(recorded, np.mean(changed, axis=0), np.mean(unchanged, axis=0), typical=0.015)
        trusted += found.overlap >= TRUSTED_OVERLAP and found.p <= TRUSTED_P
    return trusted / 200


@pytest.mark.parametrize("hard_from", [FRAMES, 36])
def test_a_twin_that_is_damaged_at_the_same_time_is_trusted_also_if_the_path_is_hard_at_another(hard_from: int) -> None:
    assert trusted_share(twin_begin=5, factor=5, hard_from=hard_from) >= 0.8


@pytest.mark.parametrize("hard_from", [FRAMES, 36])
@pytest.mark.parametrize("twin_begin", [18, 28])
def test_a_twin_that_is_damaged_at_another_time_is_not_trusted(twin_begin: int, hard_from: int) -> None:
    assert trusted_share(twin_begin=twin_begin, factor=5, hard_from=hard_from) <= 0.02


def test_errors_that_the_path_alone_explains_do_not_coincide_with_damage() -> None:
    difficulty = np.where(np.arange(FRAMES) >= 30, 0.08, 0.02)
    damaged_there = difficulty * np.where(np.arange(FRAMES) >= 30, 5, 1)
    assert twin_coincidence(difficulty, damaged_there, difficulty, typical=0.02).overlap == 0
    assert twin_coincidence(damaged_there, damaged_there, difficulty, typical=0.02).overlap == pytest.approx(1)


def test_a_few_frames_with_the_whole_error_do_not_outweigh_a_long_drift() -> None:
    unchanged = np.full(FRAMES, 0.01)
    drifting = unchanged + block(5, 35, height=0.05)
    with_spikes = drifting + block(34, 36, height=0.9)
    found = twin_coincidence(with_spikes, drifting, unchanged, typical=0.01)
    assert found.overlap > 0.9
    assert found.p <= TRUSTED_P


def test_errors_below_half_a_percent_of_the_path_are_not_raised() -> None:
    tiny = np.full(FRAMES, 1e-4)
    assert twin_coincidence(40 * tiny, 40 * tiny, tiny, typical=1e-4).overlap == 0
