"""Which nuisance an estimator fails for, on errors that are made up."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest

from vobench.analysis.explain import (
    MIN_BLOCKS,
    MORE_REPEATS,
    Change,
    Explanation,
    Outcome,
    _block_means,
    _change,
    _needs_more_repeats,
    _resampled_means,
    _suspects,
    explain,
    folder_name,
    is_sufficient,
    loss_between,
    segment_loss,
)
from vobench.analysis.nuisance import nuisances_of
from vobench.geometry import se3
from vobench.suite.case import Case
from vobench.trajectory.trajectory import Trajectory

Error = Callable[[set[str]], float]


def explained(
    hard: Case, error: Error, *, repeats: int = 3, spread: float = 0.2, parts: int = 24, unlucky: int = -1
) -> Explanation:
    """The explanation where a case with these nuisances left has that mean error."""
    nuisances = nuisances_of(hard)
    rng = np.random.default_rng(1)
    shape = {nth: rng.lognormal(0, 0.5, parts) for nth in range(MORE_REPEATS * max(repeats, MIN_BLOCKS))}

    def measure(cases: Mapping[str, Case]) -> Mapping[str, Sequence[Outcome]]:
        return {name: [outcome(case)] for name, case in cases.items()}

    def outcome(case: Case) -> Outcome:
        left = {nuisance.name for nuisance in nuisances if nuisance.remove(case) != case}
        mean = error(left if case.seed - hard.seed != unlucky else {nuisance.name for nuisance in nuisances})
        loss = mean * shape[case.seed - hard.seed] * rng.lognormal(0, spread, parts)
        return Outcome("lost" if mean > 0.5 else "ok", mean <= 0.5, np.minimum(loss, 1.0))

    return explain(hard, nuisances, measure, repeats=repeats)


def test_the_one_cause_is_named_and_no_pair_is_tried(hard: Case) -> None:
    found = explained(hard, lambda left: 0.3 if "blur" in left else 0.02)
    assert found.named == ("blur",)
    assert found.singles[0].low > 0.8
    assert not found.pairs


def test_a_short_case_is_given_more_seeds(hard: Case) -> None:
    found = explained(hard, lambda left: 0.3 if "blur" in left else 0.1, repeats=2, parts=3)
    assert found.named == ("blur",)
    assert {change.repeats for change in (found.everything, *found.singles)} == {8}


def test_where_seeds_leave_it_open_the_best_is_given_more_of_them(hard: Case) -> None:
    found = explained(hard, lambda left: 0.3 if "blur" in left else 0.02, repeats=2, unlucky=1)
    assert found.named == ("blur",)
    assert [change.repeats for change in (found.everything, *found.singles[:2])] == [6, 6, 2]


def test_two_causes_of_which_each_alone_is_enough_are_named_together(hard: Case) -> None:
    found = explained(hard, lambda left: 0.4 if left & {"noise", "calibration"} else 0.02)
    assert set(found.named) == {"noise", "calibration"}
    assert min(found.alone["noise"], found.alone["calibration"]) > 4 * found.alone["blur"]


def test_two_causes_that_add_up_are_named_together(hard: Case) -> None:
    found = explained(hard, lambda left: 0.02 + 0.2 * len(left & {"gloss", "moving things"}))
    assert set(found.named) == {"gloss", "moving things"}


def test_nothing_is_named_where_nothing_helps(hard: Case) -> None:
    assert explained(hard, lambda _: 0.3).named == ()


@pytest.mark.parametrize("seed", range(5))
def test_chance_names_nothing_surely(hard: Case, seed: int) -> None:
    rng = np.random.default_rng(seed)
    found = explained(hard, lambda _: 0.1 * rng.lognormal(0, 0.05), spread=0.6)
    assert sum(change.is_sure for change in found.singles) <= 2
    assert found.singles[0].mended < 0.4


def straight(count: int = 31) -> Trajectory:
    along = np.linspace(0, 3, count)
    R = np.eye(3)
    return Trajectory(
        (np.arange(count) * 10**8).astype(np.int64), se3.transform(R, np.stack([along, 0 * along, 0 * along], 1))
    )


def test_the_truth_has_no_error_and_no_poses_have_all_of_it() -> None:
    gt = straight()
    assert segment_loss(gt, gt) == pytest.approx(0, abs=1e-9)
    assert (segment_loss(gt, Trajectory(gt.t_ns[:0], gt.T_world_frame[:0])) == 1).all()


def test_the_error_is_a_share_of_the_way_wherever_the_estimate_starts() -> None:
    gt = straight()
    T = gt.T_world_frame.copy()
    T[:, :3, 3] *= 1.1
    start = se3.transform(se3.rotation_z(0.9), np.array([3.0, 2.0, 1.0]))
    est = Trajectory(gt.t_ns, start @ T)
    assert segment_loss(gt, est) == pytest.approx(0.1)
    assert segment_loss(gt, est, scale=1 / 1.1) == pytest.approx(0, abs=1e-9)


def test_a_wrong_turn_costs_its_radians_and_a_gap_its_two_steps() -> None:
    gt, at = straight(), np.arange(31)
    T, here = gt.T_world_frame.copy(), gt.T_world_frame[11]
    T[11:] = here @ se3.transform(se3.rotation_z(0.2), np.zeros(3)) @ se3.inverse(here) @ T[11:]
    assert loss_between(gt, Trajectory(gt.t_ns, T), at) == pytest.approx(np.where(at[:-1] == 10, 0.2, 0.0), abs=1e-6)
    kept = np.arange(31) != 10
    loss = loss_between(gt, Trajectory(gt.t_ns[kept], gt.T_world_frame[kept]), at)
    assert np.flatnonzero(loss).tolist() == [9, 10]


# --- The error of a trial ---


@pytest.mark.parametrize(("frames", "segments"), [(2, 1), (3, 1), (5, 2), (31, 15), (49, 24), (500, 24)])
def test_a_trial_has_24_segments_or_as_many_as_have_two_steps(frames: int, segments: int) -> None:
    assert len(segment_loss(straight(frames), straight(frames))) == segments


def test_segments_end_at_the_frames_that_are_nearest_to_equal_parts_of_the_time() -> None:
    t_ns = np.array([0, 10, 30, 38, 52, 60, 100]) * 10**7
    gt = Trajectory(t_ns, straight(7).T_world_frame)
    assert len(segment_loss(gt, gt)) == 3  # with borders at 33.3 and 66.7, so at the frames 2 and 5
    for lost, expected in ((2, [1, 1, 0]), (5, [0, 1, 1]), (3, [0, 0, 0]), (0, [1, 0, 0]), (6, [0, 0, 1])):
        kept = np.arange(7) != lost
        est = Trajectory(t_ns[kept], gt.T_world_frame[kept])
        assert segment_loss(gt, est).round(6).tolist() == expected, lost


def test_where_the_body_stands_still_errors_count_relative_to_the_mean_length() -> None:
    positions_m = np.zeros((5, 3))
    positions_m[:, 0] = [0, 0, 0, 1, 2]
    gt = Trajectory(np.arange(5) * 10**8, se3.transform(np.eye(3), positions_m))
    T = gt.T_world_frame.copy()
    T[1:, 1, 3] += 0.1
    found = loss_between(gt, Trajectory(gt.t_ns, T), np.array([0, 1, 2, 3, 4]))
    assert found == pytest.approx([0.1 / 0.5, 0, 0, 0])
    still = Trajectory(gt.t_ns, np.repeat(gt.T_world_frame[:1], 5, axis=0))
    T = still.T_world_frame.copy()
    T[1:, 1, 3] += 2e-4
    assert loss_between(still, Trajectory(gt.t_ns, T), np.arange(5)) == pytest.approx([0.2, 0, 0, 0])


def test_no_error_is_larger_than_that_of_a_lost_segment() -> None:
    gt = straight()
    T = gt.T_world_frame.copy()
    T[16:, 1, 3] += 50
    loss = loss_between(gt, Trajectory(gt.t_ns, T), np.arange(31))
    assert loss.max() == 1
    assert loss.sum() == pytest.approx(1)


# --- Sentences about variants ---


@pytest.mark.parametrize(
    ("removed", "name"),
    [
        ((), "as_it_is"),
        (("late IMU",), "without_late_imu"),
        (("late IMU", "blur"), "with_auto_exposure_alone"),
        (("blur",), "without_blur"),
        (("late IMU", "blur", "auto-exposure"), "without_all"),
    ],
)
def test_variants_are_named_by_what_is_removed_or_left(removed, name) -> None:
    assert folder_name(removed, ("late IMU", "blur", "auto-exposure")) == name


def test_of_two_nuisances_variants_are_named_by_what_is_removed() -> None:
    assert folder_name(("blur",), ("blur", "noise")) == "without_blur"
    assert folder_name(("blur", "noise"), ("blur", "noise")) == "without_blur_and_noise"
    assert folder_name(("blur",), ("blur",)) == "without_blur"


# --- Decisions ---


def change(*removed: str, mended: float = 0.5, low: float = 0.1, high: float = 0.9, loss: float = 0.1) -> Change:
    return Change(removed, loss, mended, low, high, 1, 1)


@pytest.mark.parametrize(("mended", "low", "is_enough"), [(0.61, 0.1, True), (0.59, 0.1, False), (0.9, -0.1, False)])
def test_a_change_is_sufficient_if_it_surely_achieves_two_thirds_of_everything(mended, low, is_enough) -> None:
    assert is_sufficient(change("blur", mended=mended, low=low), change("all", mended=0.9)) == is_enough


@pytest.mark.parametrize(
    ("best", "everything", "needs_more"),
    [
        ({"low": -0.1}, {}, True),
        ({"low": 0.1}, {"low": -0.1}, True),
        ({"low": 0.1}, {}, False),  # sure
        ({"low": -0.1, "mended": 0.19}, {}, False),  # not promising
        ({"low": -0.1, "mended": 0.21}, {}, True),
        ({"low": -0.1, "high": 0.59}, {}, False),  # cannot be two thirds of 0.9
        ({"low": -0.1, "high": 0.61}, {}, True),
    ],
)
def test_more_repeats_are_for_a_promising_nuisance_that_is_not_sure(best, everything, needs_more) -> None:
    of_everything = change("all", **{"mended": 0.9, **everything})
    assert _needs_more_repeats(change("blur", **best), of_everything) == needs_more


def test_suspects_are_the_three_that_cost_most_as_the_only_one_removed_or_left() -> None:
    everything = change("all", mended=0.8, loss=0.1)  # 0.5 before, so 0.4 to gain
    singles = [change(name, mended=mended) for name, mended in zip("abcde", (0.4, 0.08, 0.0, 0.0, 0.24), strict=True)]
    alone = {"a": 0.1, "b": 0.1, "c": 0.26, "d": 0.18, "e": 0.1}
    # As the only one removed: a 0.5, b 0.1, e 0.3; as the only one left: c 0.4, d 0.2.
    assert _suspects(singles, alone, everything) == {"a", "c", "e"}
    assert _suspects(singles, {**alone, "d": 0.24}, everything) == {"a", "c", "d"}
    nothing_left = change("all", mended=1.0, loss=0.0)
    assert _suspects(singles, {**dict.fromkeys("abcde", 0.0), "d": 0.45, "b": 0.3}, nothing_left) == {"a", "d", "b"}


def explanation(**parts) -> Explanation:
    given = {
        "loss": 0.5,
        "status": "lost",
        "repeats_differ": True,
        "everything": change("blur", "noise", "gloss", mended=0.9),
        "singles": (change("blur", mended=0.3), change("noise", mended=0.2)),
        "alone": {},
        "pairs": (change("noise", "gloss", mended=0.7), change("blur", "noise", mended=0.35)),
    }
    return Explanation(**{**given, **parts})


@pytest.mark.parametrize(
    ("parts", "named"),
    [
        ({}, ("noise", "gloss")),
        ({"everything": change("all", mended=0.9, low=-0.1)}, ()),
        ({"singles": (change("blur", mended=0.7),)}, ("blur",)),
        ({"singles": (change("blur", mended=0.3, low=-0.1),), "pairs": ()}, ()),
        ({"pairs": ()}, ("blur",)),
        ({"pairs": (change("noise", "gloss", mended=0.7, low=-0.1),)}, ("blur",)),
        ({"pairs": (change("noise", "gloss", mended=0.2),)}, ("blur",)),
    ],
)
def test_what_is_named_explains_most_and_is_sure(parts, named) -> None:
    assert explanation(**parts).named == named


# --- Figures of a change ---


def outcomes(*losses: np.ndarray) -> list[Outcome]:
    return [Outcome("ok", True, np.asarray(loss, float)) for loss in losses]


def test_the_same_errors_before_and_after_are_surely_no_change() -> None:
    rng = np.random.default_rng(0)
    before = outcomes(*rng.lognormal(-3, 1, (3, 24)))
    found = _change(("blur",), before, before)
    assert (found.mended, found.low, found.high) == (0, 0, 0)
    half = outcomes(*(outcome.loss / 2 for outcome in before))
    found = _change(("blur",), before, half)
    assert (found.mended, found.low, found.high) == pytest.approx((0.5, 0.5, 0.5))
    assert found.loss == pytest.approx(np.mean([outcome.loss for outcome in half]))
    assert found.is_sure
    worse = _change(("blur",), half, before)
    assert (worse.mended, worse.low, worse.high) == pytest.approx((-1, -1, -1))


def test_survivors_and_repeats_are_counted() -> None:
    after = [replace(outcome, survived=nth < 2) for nth, outcome in enumerate(outcomes([0.1], [0.2], [0.3]))]
    found = _change(("blur",), outcomes([0.5], [0.5], [0.5]), after)
    assert (found.survived, found.repeats) == (2, 3)
    assert found.mended == pytest.approx(0.6)


def test_errors_of_nothing_are_no_division_by_zero() -> None:
    nothing = outcomes(np.zeros(24), np.zeros(24))
    assert _change(("blur",), nothing, nothing).mended == 1
    assert np.isfinite(_change(("blur",), nothing, outcomes([0.1], [0.2])).low)


def test_the_interval_is_that_of_independent_blocks_of_three_segments() -> None:
    widths, upper_shares = [], []
    for seed in range(30):
        rng = np.random.default_rng(seed)
        blocks = 0.3 + 0.05 * rng.standard_normal((2, 4, 8))
        before, after = (outcomes(*np.repeat(side, 3, axis=1)) for side in blocks)
        found = _change(("blur",), before, after)
        widths.append(found.high - found.low)
        upper_shares.append((found.high - found.mended) / (found.high - found.low))
    # Of 32 blocks on either side; resampled ones overlap two of these, and repeats are resampled, too.
    normal = 2 * 1.96 * np.sqrt(2) * 0.05 / 0.3 / np.sqrt(32)
    assert 0.8 * normal < np.mean(widths) < 1.4 * normal
    assert np.mean(upper_shares) == pytest.approx(0.5, abs=0.03)


def test_blocks_are_three_successive_segments_and_go_round_the_end() -> None:
    outcome = Outcome("ok", True, 2.0 ** np.arange(6))
    starts = np.array([[0.0, 0.5], [0.2, 0.99], [1 / 6 + 1e-9, 0.0]])
    expected = [[0, 1, 2, 3, 4, 5], [1, 2, 3, 5, 0, 1], [1, 2, 3, 0, 1, 2]]
    assert _block_means(outcome, starts) == pytest.approx([np.mean(2.0 ** np.array(rows)) for rows in expected])
    short = Outcome("ok", True, 2.0 ** np.arange(4))  # two blocks, of which four segments are taken
    assert _block_means(short, np.array([[0.5, 0.0, 0.0]])) == pytest.approx([np.mean([4, 8, 1, 1])])


def test_resampled_means_have_the_mean_of_all_repeats() -> None:
    rng = np.random.default_rng(0)
    trials = outcomes(*(level * rng.lognormal(0, 0.3, 24) for level in (0.1, 0.2, 0.6)))
    means = _resampled_means(trials, np.random.default_rng(1))
    overall = np.mean([trial.loss.mean() for trial in trials])
    assert len(means) == 2000
    assert means.mean() == pytest.approx(overall, rel=0.03)
    # Two thirds of the draws do not have each of the three repeats once, so the spread is that between repeats.
    between = np.std([trial.loss.mean() for trial in trials]) / np.sqrt(3)
    assert means.std() == pytest.approx(between, rel=0.15)


# --- What is run ---


def test_every_variant_is_run_under_the_same_seeds_and_each_removes_what_its_name_says(hard: Case) -> None:
    ran: list[Mapping[str, Case]] = []

    def measure(cases: Mapping[str, Case]) -> Mapping[str, Sequence[Outcome]]:
        ran.append(cases)
        return {name: [Outcome("ok", True, np.full(24, 0.1 if "blur" in name else 0.5))] for name in cases}

    nuisances = [nuisance for nuisance in nuisances_of(hard) if nuisance.name in ("blur", "noise")]
    found = explain(hard, nuisances, measure)
    assert [sorted(cases) for cases in ran] == [
        ["as_it_is.0"],
        sorted(
            f"{name}.{nth}"
            for name in ("as_it_is", "without_blur", "without_noise", "without_blur_and_noise")
            for nth in range(3)
        ),
    ]
    for name, case in ran[1].items():
        assert case.seed == hard.seed + int(name[-1])
        left = {nuisance.name for nuisance in nuisances if nuisance.remove(case) != case}
        assert left == {"blur", "noise"} - set(name.partition(".")[0].removeprefix("without_").split("_and_"))
    assert found.named == ("blur",)
    assert not found.repeats_differ
    assert found.loss == pytest.approx(0.5)


def test_a_single_nuisance_is_all_of_them(hard: Case) -> None:
    def measure(cases: Mapping[str, Case]) -> Mapping[str, Sequence[Outcome]]:
        return {name: [Outcome("ok", True, np.full(24, 0.1 if "blur" in name else 0.5))] for name in cases}

    blur = [nuisance for nuisance in nuisances_of(hard) if nuisance.name == "blur"]
    found = explain(hard, blur, measure)
    assert found.everything == found.singles[0]
    assert found.named == ("blur",)


def test_the_status_is_the_most_frequent_one_and_repeats_differ_if_one_does(hard: Case) -> None:
    def measure(cases: Mapping[str, Case]) -> Mapping[str, Sequence[Outcome]]:
        made = {}
        for name in cases:
            is_last = name.endswith(".2")
            made[name] = [Outcome("ok" if is_last else "lost", is_last, np.full(24, 0.4 if is_last else 0.5))]
        return made

    found = explain(hard, nuisances_of(hard)[:1], measure)
    assert found.status == "lost"
    assert found.repeats_differ
    assert found.loss == pytest.approx((0.5 + 0.5 + 0.4) / 3)
