"""Predicted errors are those of the placements, and their intervals hold as often as they say."""

import numpy as np
import pytest

from vobench.analysis.twin_prediction import predict


def placement(**errors: float) -> dict[str, np.ndarray]:
    """Errors of segments, whose means are these."""
    return {name: np.array([[error * 0.5, np.nan], [error * 1.5, np.nan]]) for name, error in errors.items()}


def test_the_expected_error_is_the_geometric_mean_and_the_best_is_first() -> None:
    prediction = predict([placement(a=4.0, b=1.0), placement(a=1.0, b=0.25)])
    assert [row.estimator for row in prediction.errors] == ["b", "a"]
    assert [row.error for row in prediction.errors] == pytest.approx([0.5, 2.0])
    assert prediction.taus == (1.0,)


def test_the_expected_error_is_that_of_the_first_placement_if_the_others_were_drawn_around_it() -> None:
    placements = [placement(a=4.0, b=1.0), placement(a=1.0, b=0.25)]
    first = predict(placements, expects_first=True)
    assert [(row.estimator, row.error) for row in first.errors] == [("b", pytest.approx(1)), ("a", pytest.approx(4))]
    mean = predict(placements)
    for of_first, of_mean in zip(first.errors, mean.errors, strict=True):
        width_of_first = np.log(of_first.interval[1] / of_first.interval[0])
        width_of_mean = np.log(of_mean.interval[1] / of_mean.interval[0])
        assert width_of_first / width_of_mean == pytest.approx(np.sqrt(2 / 1.5))


@pytest.mark.parametrize("expects_first", [False, True])
@pytest.mark.parametrize(("place_sd", "both_sd"), [(0.3, 0.3), (0.05, 0.4), (0.5, 0.1)])
@pytest.mark.parametrize("placements", [2, 3, 5])
def test_intervals_hold_for_a_further_placement_in_95_percent_or_more(
    placements, place_sd, both_sd, expects_first
) -> None:
    rng = np.random.default_rng(7)
    names = ["a", "b", "c", "d", "e", "f", "g"]
    shares = []
    for _ in range(400):
        level = rng.normal(0, 1, len(names))
        of_places = rng.normal(0, place_sd, (placements + 1, 1))
        logs = level + of_places + rng.normal(0, both_sd, (placements + 1, len(names)))
        *known, further = [placement(**dict(zip(names, np.exp(row), strict=True))) for row in logs]
        truth = {name: float(np.nanmean(errors)) for name, errors in further.items()}
        covered, counted = predict(known, expects_first=expects_first).covered(truth)
        assert counted == len(names)
        shares.append(covered / counted)
    assert np.mean(shares) > 0.93


def test_a_single_placement_has_no_intervals_and_says_so() -> None:
    prediction = predict([placement(a=1.0, b=2.0)], basis="It rests on a guess.")
    assert [row.interval for row in prediction.errors] == [None, None]
    assert prediction.sentences() == ["It rests on a guess.", "With a single placement there are no intervals."]
    assert prediction.covered({"a": 1.0, "b": 2.0}) == (0, 0)


def test_what_did_not_run_everywhere_is_not_predicted() -> None:
    prediction = predict([placement(a=1.0, b=2.0, c=3.0), placement(c=3.0, a=1.0)])
    assert [row.estimator for row in prediction.errors] == ["a", "c"]


def test_placements_that_disagree_on_the_order_say_so() -> None:
    prediction = predict([placement(a=1, b=2, c=3), placement(a=3, b=2, c=1), placement(a=1, b=2, c=3)])
    assert sorted(prediction.taus) == pytest.approx([-1, -1, 1])
    assert prediction.sentences() == ["The orders in 3 placements agree by a tau of -0.33 (-1.00 … 1.00)."]
    facts = prediction.as_dict()
    assert [row["estimator"] for row in facts["estimators"]] == [row.estimator for row in prediction.errors]


def test_equal_placements_have_the_usual_interval_and_no_error_is_zero() -> None:
    prediction = predict([placement(a=0.0, b=2.0), placement(a=0.0, b=2.0)])
    assert [row.error for row in prediction.errors] == pytest.approx([1e-3, 2.0])
    for row in prediction.errors:
        low, high = row.interval
        assert high / row.error == pytest.approx(row.error / low)
        assert 2 < high / row.error < 4


def test_placements_that_differ_more_widen_the_interval() -> None:
    alike, unlike = (predict([placement(a=1.0, b=2.0), placement(a=f, b=2.0 * f)]).errors[0] for f in (1.1, 5.0))
    assert unlike.interval[1] / unlike.error > 1.5 * alike.interval[1] / alike.error
