"""A fault of frames that was put in is found, and its correction takes all of it away."""

import numpy as np
import pytest

from tests.analysis.test_diagnose import CAMERA, TILT, changed, loop, reordered, scaled
from vobench.analysis.mismatch import (
    SIGNED_AXES,
    _limit,
    discrete_corrections,
    find_lever,
    find_mismatch,
    misfit,
    mounted,
)
from vobench.geometry import se3
from vobench.trajectory.align import align
from vobench.trajectory.trajectory import PoseConvention


@pytest.fixture(scope="module")
def drive() -> tuple[np.ndarray, np.ndarray]:
    gt, est = loop()
    return gt.trajectory.T_world_frame, est.trajectory.T_world_frame


def found(T_gt: np.ndarray, T_est: np.ndarray, **orders):
    return find_mismatch(T_gt, T_est, **{"gt_order": "xyzw", "est_order": "xyzw", **orders})


# --- The misfit ---


@pytest.mark.parametrize("factor", [0.01, 0.5, 30.0])
def test_the_misfit_does_not_see_world_nor_scale_and_is_a_share_of_the_truths_extent(factor: float) -> None:
    gt, est = (reading.trajectory for reading in loop())
    left = misfit(gt.T_world_frame, scaled(changed(est, TILT @ est.T_world_frame), factor).T_world_frame)
    known = misfit(gt.T_world_frame, est.T_world_frame)
    assert (left.trans, left.rot_rad) == pytest.approx((known.trans, known.rot_rad), rel=1e-6)
    aligned = align(est.T_world_frame, gt.T_world_frame, kind="sim3").apply(est.T_world_frame)
    off_m = np.linalg.norm((aligned - gt.T_world_frame)[:, :3, 3], axis=1)
    from_middle_m = np.linalg.norm(gt.positions_m - gt.positions_m.mean(axis=0), axis=1)
    assert known.trans == pytest.approx(np.sqrt(np.mean(off_m**2) / np.mean(from_middle_m**2)))


def test_the_misfit_of_rotations_is_their_rms_angle_and_the_total_that_of_both(drive) -> None:
    T_gt, _ = drive
    wobble = se3.rotation_z(np.where(np.arange(len(T_gt)) % 2, 0.1, -0.1))
    left = misfit(T_gt, T_gt @ se3.transform(wobble, np.zeros(3)))
    assert left.rot_rad == pytest.approx(0.1)
    assert left.trans == pytest.approx(0, abs=1e-9)
    assert left.total == pytest.approx(0.1)
    assert misfit(T_gt, TILT @ T_gt).turned_rad == pytest.approx(float(se3.rotation_angle(TILT[:3, :3])))


# --- Discrete corrections ---


def test_there_are_47_other_axes_all_signed_permutations() -> None:
    assert len(SIGNED_AXES) == 47
    assert len({axes.tobytes() for axes in SIGNED_AXES}) == 47
    for axes in SIGNED_AXES:
        np.testing.assert_array_equal(axes @ axes.T, np.eye(3))
        assert not np.array_equal(axes, np.eye(3))


@pytest.mark.parametrize("kind", ["positions", "axes"])
@pytest.mark.parametrize("index", range(0, 47, 3))
def test_wrong_axes_are_corrected_to_the_misfit_of_right_ones(drive, kind, index) -> None:
    T_gt, T_est = drive
    axes = SIGNED_AXES[index]
    mismatch = found(T_gt, PoseConvention(kind, axes.T).apply(T_est))
    assert mismatch is not None
    right = misfit(T_gt, T_est)
    assert mismatch.correction.misfit.total == pytest.approx(right.total, rel=0.05)
    assert mismatch.before.total > 10 * right.total
    if kind == "positions":
        assert mismatch.correction.side == "est"
        is_mirrored = np.count_nonzero(np.diag(axes)) == 3
        assert mismatch.kind == ("mirrored_axes" if is_mirrored else "axis_swap")


@pytest.mark.parametrize("side", ["gt", "est"])
@pytest.mark.parametrize(("word", "kind"), [("inverse", "inverse_poses"), ("rotations", "inverse_rotations")])
def test_inverses_are_found_on_either_side_in_different_worlds(drive, side, word, kind) -> None:
    T_gt, T_est = drive
    T_est = TILT @ T_est
    given = (PoseConvention(word).apply(T_gt), T_est) if side == "gt" else (T_gt, PoseConvention(word).apply(T_est))
    mismatch = found(*given)
    assert (mismatch.kind, mismatch.correction.side, mismatch.lever) == (kind, side, None)
    np.testing.assert_allclose(mismatch.correction.T_gt, T_gt, atol=1e-9)
    np.testing.assert_allclose(mismatch.correction.T_est, T_est, atol=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_in_one_world_it_is_the_estimate_that_counts_as_inverse(seed: int) -> None:
    gt, est = (reading.trajectory.T_world_frame for reading in loop(n=200, seed=seed))
    for word in ("inverse", "rotations"):
        assert found(gt, PoseConvention(word).apply(est)).correction.side == "est"
        assert found(PoseConvention(word).apply(gt), est).correction.side == "est"


@pytest.mark.parametrize("side", ["gt", "est"])
@pytest.mark.parametrize("read_as", ["xyzw", "wxyz"])
def test_the_other_order_of_quaternions_is_undone_exactly(drive, side, read_as) -> None:
    T_gt, T_est = drive

    def misread(T: np.ndarray) -> np.ndarray:
        q = se3.to_quaternion(T[:, :3, :3])
        columns = [3, 0, 1, 2] if read_as == "xyzw" else [1, 2, 3, 0]
        return se3.transform(se3.from_quaternion(q[:, columns]), T[:, :3, 3])

    given = (misread(T_gt), T_est) if side == "gt" else (T_gt, misread(T_est))
    mismatch = found(*given, gt_order=read_as, est_order=read_as)
    assert (mismatch.kind, mismatch.correction.side, mismatch.correction.move) == ("quaternion_order", side, None)
    np.testing.assert_allclose(mismatch.correction.T_gt, T_gt, atol=1e-9)
    np.testing.assert_allclose(mismatch.correction.T_est, T_est, atol=1e-9)


def test_matrices_have_no_order_of_quaternions(drive) -> None:
    orders = [c.move for c in discrete_corrections(*drive, gt_order=None, est_order=None)]
    assert None not in orders
    assert len(orders) == 4 + 2 * 47
    with_orders = list(discrete_corrections(*drive, gt_order="xyzw", est_order="wxyz"))
    assert [c.side for c in with_orders if c.move is None] == ["est", "gt"]


def test_without_a_fault_nothing_is_found_however_bad_the_estimate(drive) -> None:
    T_gt, T_est = drive
    assert found(T_gt, T_est) is None
    assert found(T_gt, T_gt) is None
    rng = np.random.default_rng(0)
    for noise_m in (0.05, 0.5, 3.0):
        shaken = T_est.copy()
        shaken[:, :3, 3] += rng.normal(0, noise_m, (len(shaken), 3))
        assert found(T_gt, shaken) is None, noise_m


# --- Another frame of the same body ---


def bend(seed: int, drift_m: float) -> tuple[np.ndarray, np.ndarray]:
    """A bend of 0.7 m, and an estimate with its rotations, whose positions drift by so much a step at random."""
    angles_rad = np.linspace(0.0, 0.5, 31)
    positions_m = 1.35 * np.stack([np.sin(angles_rad), 1 - np.cos(angles_rad), 0 * angles_rad], 1)
    rotations = np.stack([np.asarray(se3.rotation_z(angle_rad))[:3, :3] for angle_rad in angles_rad])
    steps_m = np.random.default_rng(seed).normal(0, drift_m, positions_m.shape)
    return se3.transform(rotations, positions_m), se3.transform(rotations, positions_m + np.cumsum(steps_m, 0))


@pytest.mark.parametrize("drift_m", [0.01, 0.024, 0.05])
def test_positions_that_drift_turn_the_alignment_and_not_the_body(drift_m: float) -> None:
    kinds = [mismatch and mismatch.kind for mismatch in (found(*bend(seed, drift_m)) for seed in range(40))]
    assert "body_frame_offset" not in kinds


@pytest.mark.parametrize("T_body_other", [CAMERA, TILT, se3.transform(se3.rotation_z(0.5), (0, 0, 0))])
def test_another_frame_of_the_body_is_found_with_its_rotation_and_lever(drive, T_body_other) -> None:
    T_gt, T_est = drive
    mismatch = found(T_gt, T_est @ T_body_other)
    assert mismatch.kind == "body_frame_offset"
    expected = se3.inverse(T_body_other)
    np.testing.assert_allclose(mismatch.correction.move.matrix[:3, :3], expected[:3, :3], atol=0.01)
    np.testing.assert_allclose(mismatch.correction.move.matrix[:3, 3], expected[:3, 3], atol=0.05)
    assert (mismatch.lever is not None) == bool(np.any(T_body_other[:3, 3]))


def test_without_noise_the_lever_is_exact_in_any_world_and_scale(drive) -> None:
    T_gt, _ = drive
    T_est = TILT @ scaled_poses(T_gt @ TILT, 2.0)
    move = mounted(T_gt, T_est).move.matrix
    expected = se3.inverse(TILT)
    np.testing.assert_allclose(move[:3, :3], expected[:3, :3], atol=1e-4)
    np.testing.assert_allclose(move[:3, 3], 2 * expected[:3, 3], atol=1e-3)  # in the estimate's units


def scaled_poses(T: np.ndarray, scale: float) -> np.ndarray:
    return se3.transform(T[:, :3, :3], scale * T[:, :3, 3])


def test_a_lever_is_found_given_the_rotation_and_takes_the_misfit_of_motions_away(drive) -> None:
    T_gt, _ = drive
    lever_m = np.array([0.3, -0.2, 0.5])
    T_est = T_gt @ se3.inverse(se3.transform(np.eye(3), lever_m))
    lever = find_lever(T_gt, T_est, np.eye(3))
    np.testing.assert_allclose(lever.m, lever_m, atol=1e-6)
    assert lever.is_plain
    assert lever.ratio < 1e-5
    twice = find_lever(T_gt, T_gt @ se3.inverse(se3.transform(np.eye(3), 2 * lever_m)), np.eye(3))
    np.testing.assert_allclose(twice.m, 2 * lever_m, atol=1e-6)
    assert twice.before_m > 1.5 * lever.before_m


def test_the_misfit_of_motions_is_an_rms_length_in_metres(drive) -> None:
    T_gt, _ = drive
    rng = np.random.default_rng(0)
    sigma_m = 0.005
    T_est = T_gt.copy()
    T_est[:, :3, 3] += rng.normal(0, sigma_m, (len(T_gt), 3))
    lever = find_lever(T_gt, T_est, np.eye(3))
    assert lever.before_m == pytest.approx(np.sqrt(2 * 3) * sigma_m, rel=0.15)  # of two positions with three axes
    assert not lever.is_plain


def test_noise_alone_gives_no_lever(drive) -> None:
    T_gt, T_est = drive
    lever = find_lever(T_gt, T_est, np.eye(3))
    assert lever.m.tolist() == [0, 0, 0]
    assert (lever.ratio, lever.is_plain) == (pytest.approx(1), False)
    assert mounted(T_gt, T_est).move.matrix[:3, 3].tolist() == [0, 0, 0]


def test_a_path_without_rotation_has_no_lever_and_one_about_an_axis_none_along_it() -> None:
    s = np.linspace(0, 6, 200)
    positions_m = np.stack([5 * np.cos(s), 4 * np.sin(2 * s), 0 * s], -1)
    straight = se3.transform(np.eye(3), positions_m)
    shifted = straight @ se3.transform(np.eye(3), (0.3, 0.2, 0.1))
    assert find_lever(straight, shifted, np.eye(3)).m.tolist() == [0, 0, 0]

    flat = se3.transform(se3.rotation_z(3 * s), positions_m)
    lever_m = np.array([0.3, -0.2, 0.5])
    lever = find_lever(flat, flat @ se3.inverse(se3.transform(np.eye(3), lever_m)), np.eye(3))
    np.testing.assert_allclose(lever.m, [0.3, -0.2, 0], atol=1e-6)


def test_the_limit_of_a_geometric_series_is_exact_and_of_a_slow_one_its_last_term() -> None:
    limit = np.array([1.0, -2.0, 0.5])
    start = np.array([0.4, 0.1, -0.3])
    for ratio in (0.2, 0.5, 0.9):
        np.testing.assert_allclose(_limit([limit + start * ratio**n for n in range(3)]), limit, atol=1e-9)
    for ratio in (0.98, -0.5, 1.2):
        terms = [limit + start * ratio**n for n in range(3)]
        np.testing.assert_array_equal(_limit(terms), terms[2])
    constant = [limit] * 3
    np.testing.assert_array_equal(_limit(constant), limit)


def test_an_order_that_was_misread_is_not_taken_for_a_rotated_body() -> None:
    gt, est = loop()
    mismatch = found(gt.trajectory.T_world_frame, reordered(est.trajectory).T_world_frame)
    assert mismatch.kind == "quaternion_order"


@pytest.mark.parametrize(("turn_rad", "is_found"), [(0.02, False), (0.045, True)])
def test_a_small_turn_of_the_body_is_a_fault_beyond_three_hundredths_of_a_radian(turn_rad, is_found) -> None:
    gt, _ = loop()
    T_gt = gt.trajectory.T_world_frame
    turned = se3.transform(se3.rotation_z(turn_rad), np.zeros(3))
    mismatch = found(T_gt, T_gt @ turned)
    assert (mismatch is not None) == is_found
