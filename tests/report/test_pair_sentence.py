"""What is said of pairs: all divisions share one error, and the better estimator comes first."""

import pytest

from vobench.metric.ranking import DECIDED
from vobench.report.leaderboard import make_cells
from vobench.report.pair_sentence import named_pairs


def cells(scored, losses_of, **changes):
    """Cells of estimators with these losses, each on as many cases."""
    scores = []
    for estimator, losses in losses_of.items():
        for number, loss in enumerate(losses):
            score = {"metrics": [{"name": "ate_trans", "rmse": loss}], "failure": {"lost_aware": 1 - loss}}
            scores.append(scored(estimator, case=f"case{number}", score=score, path_m=1e3, **changes))
    return make_cells(scores, {}, {})


def test_the_better_estimator_is_named_first_with_the_ratio_of_the_other(scored):
    losses = [0.01, 0.012, 0.009, 0.011, 0.01, 0.013, 0.008, 0.01] * 3
    spread = [1.0, 1.1, 0.9, 1.0, 1.1, 0.9, 1.05, 0.95] * 3
    worse = [4 * loss * factor for loss, factor in zip(losses, spread, strict=True)]
    (pair,) = named_pairs(cells(scored, {"a": worse, "b": losses}), ratio=1.5)
    assert (pair.first, pair.second) == ("b", "a")
    assert pair.known.loss_ratio == pytest.approx(4, rel=0.01)
    assert pair.sentence.startswith("a has 3.99 × b's loss [")
    assert pair.sentence.endswith("]: decided")


def test_few_units_have_no_interval(scored):
    (pair,) = named_pairs(cells(scored, {"a": [0.01, 0.02], "b": [0.01, 0.03]}), ratio=1.5)
    assert pair.sentence == "b has 1.22 × a's loss (too few units for an interval): open"


def test_the_pairs_of_all_divisions_share_the_error(scored):
    losses = [0.01, 0.02, 0.03]
    se3 = cells(scored, {"a": losses, "b": losses, "c": losses})
    sim3 = cells(scored, {"d": losses, "e": losses}, claims=("Sim(3)",))
    pairs = named_pairs([*se3, *sim3], ratio=1.5)
    assert len(pairs) == 4
    assert sum(pair.known.alpha for pair in pairs) == pytest.approx(DECIDED)


def test_baselines_are_not_compared(scored):
    losses = [0.01, 0.02]
    baseline = cells(scored, {"still": losses}, claims=("baseline",))
    assert named_pairs([*cells(scored, {"a": losses}), *baseline], ratio=1.5) == []
