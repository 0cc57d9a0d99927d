"""An offset of disparity that was put into tracked points is found, as certain as it is stated."""

from dataclasses import replace

import numpy as np
import pytest

from tests.analysis.test_stereo_fit import RIG, shots, turned
from vobench.analysis import disparity_offset
from vobench.analysis.disparity_offset import (
    SHARED_SIGMA,
    TrackedPoints,
    _cauchy_weights,
    _Model,
    _moved,
    _NormalEquations,
    _true_information,
    _true_motion,
    fit_offset,
)
from vobench.analysis.stereo_matches import PairShot, match_shots
from vobench.estimator.stereo import stereo_pair
from vobench.geometry import se3

PAIR = stereo_pair(RIG, "test")
FOCAL_PX = 300.0
BASELINE_M = 0.2
NO_TURN = np.zeros(2)
AHEAD = se3.transform(se3.rotation_z(0.0), (0.03, -0.02, -0.4))  # T_after_before of a step of 0.4 m


def tracks(
    *,
    offset_px: float = 0.0,
    T: np.ndarray = AHEAD,
    sigma_px: float = 0.0,
    count: int = 400,
    seed: int = 0,
    roll_pitch_rad: tuple[float, float] = (0.0, 0.0),
    is_known: bool = True,
) -> TrackedPoints:
    """Points at 2 to 20 m that a pair with an offset of disparity sees before and after a motion."""
    rng = np.random.default_rng(seed)
    z_m = 1 / rng.uniform(1 / 20, 1 / 2, count)
    x, y = rng.uniform(-0.5, 0.5, count), rng.uniform(-0.35, 0.35, count)
    points_m = np.c_[x * z_m, y * z_m, z_m]
    true_disparity_px = FOCAL_PX * BASELINE_M / z_m
    roll, pitch = roll_pitch_rad
    right_x = x - true_disparity_px / FOCAL_PX
    for _ in range(5):  # the excess depends on where the right camera sees the point
        excess_px = offset_px * (1 + right_x**2) - FOCAL_PX * (roll * y + pitch * right_x * y)
        right_x = x - (true_disparity_px + excess_px) / FOCAL_PX
    after_m = se3.apply(T, points_m)
    centre_px = np.array([PAIR.K[0, 2], PAIR.K[1, 2]])
    noise_px = rng.normal(0, sigma_px, (count, 3)) if sigma_px else np.zeros((count, 3))
    return TrackedPoints(
        before_px=np.c_[x, y] * FOCAL_PX + centre_px,
        after_px=after_m[:, :2] / after_m[:, 2:] * FOCAL_PX + centre_px + noise_px[:, :2],
        disparity_px=true_disparity_px + excess_px + noise_px[:, 2],
        T_after_before=T,
        information=_true_information(T) if is_known else np.zeros((6, 6)),
    )


def offset_of(monkeypatch, *all_tracks: TrackedPoints, roll_pitch_rad=(0.0, 0.0)):
    monkeypatch.setattr(disparity_offset, "_tracks", lambda *_: list(all_tracks))
    return fit_offset([], PAIR, np.array(roll_pitch_rad))


@pytest.mark.parametrize("offset_px", [0.0, 0.5, -0.5])
def test_an_offset_is_found_by_known_motions(monkeypatch, offset_px: float) -> None:
    found = offset_of(monkeypatch, *(tracks(offset_px=offset_px, seed=seed) for seed in range(3)))
    assert found.value_px == pytest.approx(offset_px, abs=0.03)
    assert 0 < found.sigma_px < 0.1


def test_roll_and_pitch_that_the_rows_show_are_taken_out_first(monkeypatch) -> None:
    angles = (0.003, -0.002)
    for roll_pitch_rad in ((0.003, 0.0), (0.0, 0.004), angles):
        given = tracks(offset_px=0.3, roll_pitch_rad=roll_pitch_rad)
        found = offset_of(monkeypatch, given, roll_pitch_rad=roll_pitch_rad)
        assert found.value_px == pytest.approx(0.3, abs=0.03)


def test_wrong_scale_and_cameras_are_told_from_an_offset(monkeypatch) -> None:
    plain = tracks(offset_px=0.4)
    stretched = replace(plain, disparity_px=1.003 * plain.disparity_px)
    assert offset_of(monkeypatch, stretched).value_px == pytest.approx(0.4, abs=0.1)


def test_an_offset_is_found_without_true_motions_too_but_less_surely(monkeypatch) -> None:
    known = offset_of(monkeypatch, tracks(offset_px=0.5, sigma_px=0.1))
    unknown = offset_of(monkeypatch, tracks(offset_px=0.5, sigma_px=0.1, is_known=False))
    assert unknown is None or unknown.sigma_px > known.sigma_px
    start = se3.transform(se3.rotation_z(0.002), (0.035, -0.02, -0.395))
    sharp = [replace(tracks(offset_px=0.5, is_known=False, seed=seed), T_after_before=start) for seed in range(3)]
    found = offset_of(monkeypatch, *sharp)
    assert found is not None
    assert abs(found.value_px - 0.5) < 3 * found.sigma_px


def test_more_motions_are_surer_and_the_stated_deviation_covers_the_error(monkeypatch) -> None:
    one = offset_of(monkeypatch, tracks(offset_px=0.3, sigma_px=0.3))
    several = offset_of(monkeypatch, *(tracks(offset_px=0.3, sigma_px=0.3, seed=seed) for seed in range(4)))
    assert several.sigma_px < 0.75 * one.sigma_px
    errors = []
    for seed in range(8):
        found = offset_of(monkeypatch, tracks(offset_px=0.3, sigma_px=0.3, seed=seed))
        errors.append((found.value_px - 0.3) / found.sigma_px)
    assert np.sqrt(np.mean(np.square(errors))) < 1.5


def test_outliers_hardly_move_the_offset(monkeypatch) -> None:
    plain = tracks(offset_px=0.4, sigma_px=0.1)
    after_px = plain.after_px.copy()
    after_px[:40] += 8.0
    assert offset_of(monkeypatch, replace(plain, after_px=after_px)).value_px == pytest.approx(0.4, abs=0.1)


def test_without_motion_nothing_is_determined(monkeypatch) -> None:
    assert offset_of(monkeypatch) is None
    still = tracks(offset_px=0.4, T=se3.transform(np.eye(3), (0.001, 0.0, -0.001)), sigma_px=0.2)
    assert offset_of(monkeypatch, still) is None


# --- The parts ---


def test_the_model_gives_what_the_pair_sees() -> None:
    given = tracks(offset_px=0.6, roll_pitch_rad=(0.002, -0.003))
    z_m = 1 / np.random.default_rng(0).uniform(1 / 20, 1 / 2, 400)
    model = _Model(given, PAIR, np.array([0.002, -0.003]))
    expected = model.measurements(AHEAD, np.array([0.6, 0, 0, 0, 0]), 1 / z_m)
    np.testing.assert_allclose(expected, np.c_[given.disparity_px, given.after_px], atol=1e-6)
    scaled = model.measurements(AHEAD, np.array([0.6, 0.01, 0, 0, 0]), 1 / z_m)
    np.testing.assert_allclose(scaled[:, 0] - expected[:, 0], 0.01 * FOCAL_PX * BASELINE_M / z_m, atol=1e-9)


def test_a_still_camera_of_another_lens_sees_points_where_they_were() -> None:
    given = tracks()
    model = _Model(given, PAIR, NO_TURN)
    for shared in ([0, 0, 2.0, 0, 0], [0, 0, 0, -2.0, 0], [0, 0, 0, 0, 0.01]):
        seen = model.measurements(np.eye(4), np.array(shared), np.full(400, 0.2))
        np.testing.assert_allclose(seen[:, 1:], given.before_px, atol=1e-9)


def test_the_jacobian_predicts_small_changes() -> None:
    given = tracks(count=50)
    model = _Model(given, PAIR, NO_TURN)
    inverse_depth = np.linspace(0.05, 0.5, 50)
    shared = np.zeros(5)
    jacobian = model._jacobian(AHEAD, shared, inverse_depth)
    assert jacobian.shape == (50, 3, 11)
    change = np.array([2e-3, -1e-3, 3e-3, 1e-4, 2e-4, -1e-4, 0.05, 1e-3, 0.05, -0.05, 1e-4])
    before = model.measurements(AHEAD, shared, inverse_depth)
    after = model.measurements(_moved(AHEAD, change[:6]), change[6:], inverse_depth)
    np.testing.assert_allclose(after - before, jacobian @ change, atol=0.01)
    assert np.abs(after - before).max() > 0.3


def test_depths_are_fitted_to_disparity_and_flow() -> None:
    given = tracks()
    model = _Model(given, PAIR, NO_TURN)
    inverse_depth, residual_px, direction = model._fit_depths(AHEAD, np.zeros(5))
    np.testing.assert_allclose(inverse_depth, given.disparity_px / (FOCAL_PX * BASELINE_M), rtol=1e-6)
    np.testing.assert_allclose(residual_px, 0, atol=1e-6)
    np.testing.assert_allclose(np.linalg.norm(direction, axis=1), 1)


def test_weights_fall_to_a_half_at_2_4_standard_deviations() -> None:
    rng = np.random.default_rng(0)
    residual_px = rng.normal(0, 0.5, (20_001, 2))
    residual_px = np.c_[residual_px, np.zeros(len(residual_px))]
    residual_px[0] = 0
    residual_px[1] = [2.4 * 0.5, 0, 0]
    weight = _cauchy_weights(residual_px)
    assert weight[0] == pytest.approx(1 / (8 * 0.25), rel=0.03)
    assert weight[1] == pytest.approx(weight[0] / 2, rel=0.03)
    assert _cauchy_weights(np.zeros((5, 3))) == pytest.approx(1 / (8 * 0.03**2))


def test_eliminating_the_motion_gives_the_solution_of_all_unknowns_together() -> None:
    rng = np.random.default_rng(0)
    A = rng.standard_normal((30, 11))
    matrix, right_side = A.T @ A, rng.standard_normal(11)
    whole = np.linalg.solve(matrix, right_side)
    equations = _NormalEquations(matrix, right_side)
    shared_step = np.linalg.solve(*equations.without_motion())
    np.testing.assert_allclose(shared_step, whole[6:])
    np.testing.assert_allclose(equations.motion_step(shared_step), whole[:6])


def test_a_step_moves_and_turns_a_motion() -> None:
    moved = _moved(AHEAD, np.array([0.1, 0.2, 0.3, 0, 0, 0.4]))
    np.testing.assert_allclose(moved[:3, 3], AHEAD[:3, 3] + [0.1, 0.2, 0.3])
    np.testing.assert_allclose(moved[:3, :3], se3.rotation_z(0.4) @ AHEAD[:3, :3], atol=1e-12)


def test_true_motions_are_less_certain_the_longer_they_are() -> None:
    for length_m in (0.0, 0.5, 2.0):
        information = np.diag(_true_information(se3.transform(np.eye(3), (0, length_m, 0))))
        np.testing.assert_allclose(information[:3] ** -0.5, 3e-4 + 2e-3 * length_m)
        np.testing.assert_allclose(information[3:] ** -0.5, 5e-4)


def test_the_true_motion_is_that_between_the_two_views() -> None:
    image = np.zeros((2, 2), np.uint8)
    first, last = (se3.transform(se3.rotation_z(0.1 * k), (0.2 * k, 0.1, 0.3 * k)) for k in (1, 2))
    motion = _true_motion(PairShot(image, image, first), PairShot(image, image, last), PAIR)
    np.testing.assert_allclose(motion, se3.inverse(last) @ first, atol=1e-9)  # the view has the left camera's axes
    assert _true_motion(PairShot(image, image, first), PairShot(image, image), PAIR) is None
    assert _true_motion(PairShot(image, image), PairShot(image, image, last), PAIR) is None


# --- Tracks of painted walls ---


@pytest.fixture(scope="module")
def matched():
    return match_shots(shots(turned(0.0, 0.0, 0.0)), PAIR)


def test_points_are_tracked_to_where_the_motion_takes_them(matched) -> None:
    found = disparity_offset._track(matched, PAIR)
    assert len(found.disparity_px) > 100
    points_m = PAIR.points(found.before_px, found.disparity_px)
    after_m = se3.apply(found.T_after_before, points_m)
    expected_px = after_m[:, :2] / after_m[:, 2:] * FOCAL_PX + [PAIR.K[0, 2], PAIR.K[1, 2]]
    assert np.median(np.linalg.norm(expected_px - found.after_px, axis=1)) < 0.3
    assert found.T_after_before[2, 3] == pytest.approx(-0.12 * (len(matched) - 1))
    assert found.information[0, 0] > 0


def test_without_a_true_motion_it_is_estimated_and_nothing_is_known_beforehand(matched) -> None:
    unknown = [replace(each, shot=replace(each.shot, T_world_left=None)) for each in matched]
    found = disparity_offset._track(unknown, PAIR)
    assert not found.information.any()
    assert found.T_after_before[2, 3] == pytest.approx(-0.12 * (len(matched) - 1), abs=0.02)


def test_a_view_that_stands_still_or_is_lost_has_no_tracks(matched) -> None:
    again = [replace(matched[0], shot=replace(matched[0].shot)) for _ in range(3)]
    assert disparity_offset._track(again, PAIR) is None  # no flow
    assert disparity_offset._track(matched[:1], PAIR) is None
    blank = replace(matched[1], shot=replace(matched[1].shot, left=np.full((240, 320), 90, np.uint8)))
    assert disparity_offset._track([matched[0], blank], PAIR) is None
    few = replace(
        matched[0], **{name: getattr(matched[0], name)[:39] for name in ("left_px", "right_px", "disparity_px")}
    )
    assert disparity_offset._track([few, *matched[1:]], PAIR) is None


def test_tracks_without_a_motion_that_explains_them_are_left_out(matched, monkeypatch) -> None:
    monkeypatch.setattr(disparity_offset, "pose_from_points", lambda *_, **__: None)
    assert disparity_offset._track(matched, PAIR) is None


def test_tracks_that_are_lost_later_end_at_the_last_view_that_has_them(matched) -> None:
    blank = replace(matched[3], shot=replace(matched[3].shot, left=np.full((240, 320), 90, np.uint8)))
    found = disparity_offset._track([*matched[:3], blank], PAIR)
    assert found.T_after_before[2, 3] == pytest.approx(-0.12 * 2)


def test_motions_are_taken_over_five_frames_of_each_run(matched, monkeypatch) -> None:
    lengths = []
    monkeypatch.setattr(disparity_offset, "_track", lambda window, _: lengths.append(len(window)))
    assert disparity_offset._tracks([[*matched, *matched][:8], matched[:5]], PAIR) == []
    assert lengths == [6, 6, 6]
    assert len(SHARED_SIGMA) == 5
