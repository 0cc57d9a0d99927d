"""Points are tracked to where a motion takes them, and the model of a motion gives what a pair sees of it."""

from dataclasses import replace

import numpy as np
import pytest

from tests.analysis.test_stereo_fit import RIG, shots, turned
from vobench.analysis import tracked_motion
from vobench.analysis.stereo_matches import PairShot, match_shots
from vobench.analysis.tracked_motion import (
    Linearization,
    MotionModel,
    NormalEquations,
    _true_motion,
    moved,
    track_motions,
    true_information,
)
from vobench.estimator.stereo import stereo_pair
from vobench.geometry import se3

PAIR = stereo_pair(RIG, "test")
FOCAL_PX = 300.0
AHEAD = se3.transform(se3.rotation_z(0.0), (0.03, -0.02, -0.4))  # T_after_before of a step of 0.4 m
COUNT = 50
INVERSE_DEPTH = np.linspace(0.05, 0.5, COUNT)


def model() -> MotionModel:
    """The model of points that depends on three errors, the first of which scales disparities."""
    rng = np.random.default_rng(0)
    before_px = rng.uniform([20, 20], [300, 220], (COUNT, 2))
    exact = MotionModel(
        K=PAIR.K,
        focal_baseline=PAIR.focal_baseline,
        before_px=before_px,
        after_px=before_px,
        disparity_px=INVERSE_DEPTH * PAIR.focal_baseline,
        before_by=rng.normal(0, 1, (COUNT, 2, 3)),
        after_by=rng.normal(0, 1, (COUNT, 2, 3)),
        disparity_by=rng.normal(0, 1, (COUNT, 3)) * [0, 1, 1],
        scale_by=np.tile([0.006, 0.0, 0.0], (COUNT, 1)),
        information=np.zeros((6, 6)),
        region=np.zeros(COUNT, np.int64),
    )
    seen = exact.expected(AHEAD, np.zeros(3), INVERSE_DEPTH)
    return replace(exact, after_px=seen[:, 1:])


def test_the_model_gives_the_disparities_and_pixels_of_points() -> None:
    given = model()
    seen = given.expected(AHEAD, np.zeros(3), INVERSE_DEPTH)
    rays = np.c_[(given.before_px - PAIR.K[:2, 2]) / FOCAL_PX, np.ones(COUNT)]
    points_m = se3.apply(AHEAD, rays / INVERSE_DEPTH[:, None])
    np.testing.assert_allclose(seen[:, 0], FOCAL_PX * 0.2 * INVERSE_DEPTH)
    np.testing.assert_allclose(seen[:, 1:], points_m[:, :2] / points_m[:, 2:] * FOCAL_PX + PAIR.K[:2, 2])
    scaled = given.expected(AHEAD, np.array([2.0, 0, 0]), INVERSE_DEPTH)
    np.testing.assert_allclose(scaled[:, 0], 1.012 * seen[:, 0])


def test_the_jacobian_predicts_small_changes() -> None:
    given = model()
    jacobian = given._jacobian(AHEAD, np.zeros(3), INVERSE_DEPTH)
    assert jacobian.shape == (COUNT, 3, 9)
    before = given.expected(AHEAD, np.zeros(3), INVERSE_DEPTH)
    change = 1e-5 * np.array([20.0, -10, 30, 1, 2, -1, 500, 300, -200])
    after = given.expected(moved(AHEAD, change[:6]), change[6:], INVERSE_DEPTH)
    np.testing.assert_allclose(after - before, jacobian @ change, atol=2e-5)
    assert np.abs(after - before).max() > 1e-3


def test_depths_are_fitted_to_disparity_and_flow() -> None:
    given = model()
    np.testing.assert_allclose(given.fitted_depths(AHEAD, np.zeros(3)), INVERSE_DEPTH, rtol=1e-9)
    fit = given.linearized(AHEAD, np.zeros(3))
    np.testing.assert_allclose(fit.residual_px, 0, atol=1e-9)
    direction = given._by_depth(AHEAD, np.zeros(3), INVERSE_DEPTH)
    np.testing.assert_allclose(np.einsum("ni,nij->nj", direction, fit.jacobian), 0, atol=1e-6)


def test_weights_fall_to_a_half_at_2_4_standard_deviations() -> None:
    rng = np.random.default_rng(0)
    residual_px = np.c_[rng.normal(0, 0.5, (20_001, 2)), np.zeros(20_001)]
    residual_px[0] = 0
    residual_px[1] = [2.4 * 0.5, 0, 0]
    fit = Linearization(residual_px, np.zeros((20_001, 3, 7)))
    assert fit.noise_px() == pytest.approx(0.5, rel=0.02)
    weight = fit.cauchy(0.5)
    assert weight[0] == 1
    assert weight[1] == pytest.approx(0.5)
    assert Linearization(np.zeros((5, 3)), np.zeros((5, 3, 7))).noise_px() == pytest.approx(0.03)


def test_scores_sum_to_the_right_side_of_the_normal_equations() -> None:
    rng = np.random.default_rng(0)
    fit = Linearization(rng.normal(0, 1, (30, 3)), rng.normal(0, 1, (30, 3, 8)))
    weight = rng.uniform(0.5, 1, 30)
    equations = fit.normal_equations(weight, np.zeros((6, 6)), np.zeros(6))
    np.testing.assert_allclose(fit.scores(weight).sum(0), equations.right_side)
    prior = fit.normal_equations(weight, 2 * np.eye(6), np.ones(6))
    np.testing.assert_allclose(prior.right_side[:6], equations.right_side[:6] - 2)


def test_eliminating_the_motion_gives_the_solution_of_all_unknowns_together() -> None:
    rng = np.random.default_rng(0)
    A = rng.standard_normal((30, 11))
    matrix, right_side = A.T @ A, rng.standard_normal(11)
    whole = np.linalg.solve(matrix, right_side)
    equations = NormalEquations(matrix, right_side)
    shared_step = np.linalg.solve(*equations.without_motion())
    np.testing.assert_allclose(shared_step, whole[6:])
    np.testing.assert_allclose(equations.motion_step(shared_step), whole[:6])


def test_a_step_moves_and_turns_a_motion() -> None:
    later = moved(AHEAD, np.array([0.1, 0.2, 0.3, 0, 0, 0.4]))
    np.testing.assert_allclose(later[:3, 3], AHEAD[:3, 3] + [0.1, 0.2, 0.3])
    np.testing.assert_allclose(later[:3, :3], se3.rotation_z(0.4) @ AHEAD[:3, :3], atol=1e-12)


def test_true_motions_are_less_certain_the_longer_they_are() -> None:
    for length_m in (0.0, 0.5, 2.0):
        information = np.diag(true_information(se3.transform(np.eye(3), (0, length_m, 0))))
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
    found = tracked_motion._track(matched, PAIR, window=0)
    assert len(found.disparity_px) > 100
    points_m = PAIR.points(found.left_px, found.disparity_px)
    after_m = se3.apply(found.T_after_before, points_m)
    expected_px = after_m[:, :2] / after_m[:, 2:] * FOCAL_PX + [PAIR.K[0, 2], PAIR.K[1, 2]]
    assert np.median(np.linalg.norm(expected_px - found.after_px, axis=1)) < 0.3
    assert found.T_after_before[2, 3] == pytest.approx(-0.12 * (len(matched) - 1))
    assert found.information[0, 0] > 0


def test_without_a_true_motion_it_is_estimated_and_nothing_is_known_beforehand(matched) -> None:
    unknown = [replace(each, shot=replace(each.shot, T_world_left=None)) for each in matched]
    found = tracked_motion._track(unknown, PAIR, window=0)
    assert not found.information.any()
    assert found.T_after_before[2, 3] == pytest.approx(-0.12 * (len(matched) - 1), abs=0.02)


def test_a_view_that_stands_still_or_is_lost_has_no_tracks(matched) -> None:
    again = [replace(matched[0], shot=replace(matched[0].shot)) for _ in range(3)]
    assert tracked_motion._track(again, PAIR, window=0) is None  # no flow
    assert tracked_motion._track(matched[:1], PAIR, window=0) is None
    blank = replace(matched[1], shot=replace(matched[1].shot, left=np.full((240, 320), 90, np.uint8)))
    assert tracked_motion._track([matched[0], blank], PAIR, window=0) is None
    few = replace(
        matched[0], **{name: getattr(matched[0], name)[:39] for name in ("left_px", "right_px", "disparity_px")}
    )
    assert tracked_motion._track([few, *matched[1:]], PAIR, window=0) is None


def test_tracks_without_a_motion_that_explains_them_are_left_out(matched, monkeypatch) -> None:
    monkeypatch.setattr(tracked_motion, "pose_from_points", lambda *_, **__: None)
    assert tracked_motion._track(matched, PAIR, window=0) is None


def test_tracks_that_are_lost_later_end_at_the_last_view_that_has_them(matched) -> None:
    blank = replace(matched[3], shot=replace(matched[3].shot, left=np.full((240, 320), 90, np.uint8)))
    found = tracked_motion._track([*matched[:3], blank], PAIR, window=0)
    assert found.T_after_before[2, 3] == pytest.approx(-0.12 * 2)


def test_motions_are_taken_over_five_frames_of_each_run(matched, monkeypatch) -> None:
    lengths = []
    monkeypatch.setattr(tracked_motion, "_track", lambda shots, _, *, window: lengths.append((window, len(shots))))
    assert track_motions([[*matched, *matched][:8], matched[:5]], PAIR) == []
    assert lengths == [(0, 6), (0, 6), (0, 6)]
