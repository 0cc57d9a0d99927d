"""Which nuisance an estimator fails for, on errors that are made up."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
import pytest

from vobench.analysis.explain import (
    MIN_BLOCKS,
    MORE_REPEATS,
    Explanation,
    Outcome,
    explain,
    loss_between,
    segment_loss,
)
from vobench.analysis.nuisance import nuisances_of
from vobench.geometry import se3
from vobench.suite.suite import Case
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
