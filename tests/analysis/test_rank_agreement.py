"""Orders of estimators are compared by errors that are known."""

import numpy as np
import pytest

from vobench.analysis.rank_agreement import LOST_PERCENT, agreement, segment_errors
from vobench.errors import InputError
from vobench.geometry import se3
from vobench.trajectory.trajectory import Trajectory


def walk(scale: float = 1.0, drift: float = 0.0) -> Trajectory:
    places = np.stack([np.linspace(0, 10, 100), np.linspace(0, 10, 100) ** 2 * drift, np.zeros(100)], -1)
    return Trajectory(np.arange(100) * 10**8, se3.transform(np.eye(3), places * scale))


def test_an_error_of_scale_is_that_share_of_every_segment():
    errors = segment_errors(walk(), walk(1.02))
    assert np.nanmin(errors) == pytest.approx(2)
    assert np.nanmax(errors) == pytest.approx(2)
    assert np.nanmax(segment_errors(walk(), walk(1.02), scaled=True)) < 1e-6


def test_a_missing_pose_is_a_lost_segment():
    half = Trajectory(walk().t_ns[:50], walk().T_world_frame[:50])
    errors = segment_errors(walk(), half)
    assert np.nanmax(errors) == LOST_PERCENT
    assert np.isfinite(errors).sum() == np.isfinite(segment_errors(walk(), walk())).sum()
    nothing = segment_errors(walk(), Trajectory(half.t_ns[:0], half.T_world_frame[:0]))
    assert np.nanmin(nothing) == LOST_PERCENT


def test_equal_orders_have_tau_1_and_reversed_ones_minus_1():
    drifts = {name: segment_errors(walk(), walk(1 + 0.01 * n)) for n, name in enumerate("abcdef", 1)}
    same = agreement(drifts, drifts)
    assert [same.tau, same.low, same.high] == pytest.approx([1, 1, 1])
    turned = dict(zip(drifts, reversed(drifts.values()), strict=True))
    assert agreement(drifts, turned).tau == pytest.approx(-1)
    with pytest.raises(InputError, match="3 estimators or more"):
        agreement(drifts, {"a": drifts["a"]})


def test_segments_have_a_twelfth_to_eight_twelfths_of_the_path() -> None:
    gt = walk()
    errors = segment_errors(gt, walk(1.02))
    assert errors.shape == (8, 100)
    starts = np.isfinite(errors).sum(1)
    # A segment of k twelfths can start in the first 12 - k twelfths of the path.
    np.testing.assert_allclose(starts, 100 * (1 - np.arange(1, 9) / 12), atol=1.5)
    for row in np.isfinite(errors):
        assert row[: row.sum()].all()


def test_errors_do_not_depend_on_the_world_of_the_estimate_nor_on_its_own_frame_at_the_start() -> None:
    gt, est = walk(), walk(1.05, drift=0.01)
    moved = Trajectory(est.t_ns, se3.transform(se3.rotation_z(0.7), (3.0, -2.0, 1.0)) @ est.T_world_frame)
    np.testing.assert_allclose(segment_errors(gt, moved), segment_errors(gt, est), atol=1e-6)


def test_an_error_is_the_distance_of_the_ends_over_the_length_of_the_segment() -> None:
    gt = walk()
    T = gt.T_world_frame.copy()
    T[60:, 1, 3] += 0.2  # a jump aside
    errors = segment_errors(gt, Trajectory(gt.t_ns, T))
    for row, share in enumerate(np.arange(1, 9) / 12):
        across = [start for start in range(60) if np.isfinite(errors[row, start]) and start + 99 * share > 61]
        if across:
            assert errors[row, across] == pytest.approx(100 * 0.2 / (10 * share), rel=0.15)
    assert errors[0, :50] == pytest.approx(0, abs=1e-9)
    assert errors[0, 61:90] == pytest.approx(0, abs=1e-9)


def test_a_rotated_start_counts_as_the_distance_that_it_costs() -> None:
    gt = walk()
    T = gt.T_world_frame.copy()
    T[:, :3, :3] = se3.rotation_z(np.full(len(T), 0.05)) @ T[:, :3, :3]
    errors = segment_errors(gt, Trajectory(gt.t_ns, T))
    assert errors[np.isfinite(errors)] == pytest.approx(100 * 2 * np.sin(0.025), rel=1e-6)


def test_an_estimate_without_scale_gets_the_truths_from_three_poses_on() -> None:
    gt = walk(drift=0.02)
    half_size = walk(0.5, drift=0.02)
    assert np.nanmax(segment_errors(gt, half_size, scaled=True)) < 1e-6
    distances_m = gt.distances_m()
    middle = int(np.searchsorted(distances_m, distances_m[-1] / 2))
    three, two = (
        Trajectory(half_size.t_ns[rows], half_size.T_world_frame[rows]) for rows in ([0, middle, 99], [0, middle])
    )
    known = segment_errors(gt, three, scaled=True)
    assert np.nanmin(known) == pytest.approx(0, abs=1e-6)
    assert np.nanmin(segment_errors(gt, two, scaled=True)) == pytest.approx(50, rel=0.01)


# --- Agreement ---


def errors_of(means: dict[str, float], *, spread: float = 0.0, seed: int = 0) -> dict[str, np.ndarray]:
    """Errors of segments with these means, which vary by stretches of the recording."""
    rng = np.random.default_rng(seed)
    of_estimators = {}
    for name, mean in means.items():
        of_stretches = mean * np.exp(spread * rng.standard_normal(10))
        of_estimators[name] = np.tile(np.repeat(of_stretches, 10), (8, 1))
    return of_estimators


MEANS = {name: 1.0 + 0.2 * nth for nth, name in enumerate("abcde")}


def test_one_exchange_of_neighbours_costs_a_tenth_of_the_ten_pairs_twice() -> None:
    exchanged = {**MEANS, "a": MEANS["b"], "b": MEANS["a"]}
    found = agreement(errors_of(MEANS), errors_of(exchanged))
    assert found.tau == pytest.approx(0.8)
    assert (found.low, found.high) == pytest.approx((0.8, 0.8))
    assert found.errors == {name: (pytest.approx(MEANS[name]), pytest.approx(exchanged[name])) for name in MEANS}


def test_the_interval_widens_with_what_differs_between_stretches_and_has_95_percent_of_the_draws() -> None:
    narrow, wide = (
        agreement(errors_of(MEANS, spread=spread), errors_of(MEANS, spread=spread, seed=1)) for spread in (0.1, 0.6)
    )
    assert wide.low < narrow.low <= narrow.high <= 1
    assert wide.low <= wide.tau <= wide.high
    assert wide.low < 0.5


def test_an_interval_is_the_same_each_time_and_another_seed_changes_only_the_interval() -> None:
    means = {name: 1.0 + 0.02 * nth for nth, name in enumerate("abcdefghijklmnop")}
    first = errors_of(means, spread=0.6)
    second = errors_of(means, spread=0.6, seed=1)
    default = agreement(first, second)
    assert agreement(first, second, seed=0) == default
    others = [agreement(first, second, seed=seed) for seed in (1, 2, 3, 4, 5)]
    assert {other.tau for other in others} == {default.tau}
    assert any((other.low, other.high) != (default.low, default.high) for other in others)


def test_only_estimators_that_ran_on_both_are_compared() -> None:
    found = agreement(errors_of({**MEANS, "only_here": 0.1}), errors_of({"only_there": 9.0, **MEANS}))
    assert list(found.errors) == list(MEANS)
    assert found.tau == pytest.approx(1)


def test_segments_that_do_not_exist_have_no_weight() -> None:
    first = errors_of({"a": 1.0, "b": 2.0, "c": 3.0})
    first["a"][4:] = np.nan
    first["a"][:, 50:] = np.nan
    found = agreement(first, errors_of({"a": 1.0, "b": 2.0, "c": 3.0}))
    assert found.errors["a"] == pytest.approx((1.0, 1.0))


def test_estimators_that_are_all_alike_have_no_order() -> None:
    found = agreement(errors_of(dict.fromkeys("abc", 1.0)), errors_of(MEANS))
    assert (found.tau, found.low, found.high) == (0, 0, 0)
