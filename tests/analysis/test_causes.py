"""What errors depend on, where that is known."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.analysis.causes import (
    Attribution,
    Cause,
    ErrorSeries,
    attribute,
    corrected_p_values,
    reason_for_no_answer,
)
from vobench.geometry.se3 import Array


def courses(slope: dict[str, float], *, trials: int = 4, frames: int = 121, twin: bool = False) -> list[ErrorSeries]:
    """Trials whose error's logarithm is these slopes times the square roots of conditions, and noise."""
    rng = np.random.default_rng(3)
    made = []
    for nth in range(trials):
        held: dict[str, Array] = {name: np.repeat(rng.uniform(0, 4, frames // 5 + 1), 5)[:frames] for name in "abcd"}
        held["flat"] = np.full(frames, 2.0)
        if twin:
            held["twin"] = 3 * held["a"]
        log = sum(k * np.sqrt(held[name]) for name, k in slope.items()) + rng.normal(0, 0.3, frames) - 6
        loss = np.minimum(np.exp(log), 1.0)
        loss[0] = 0.0
        made.append(ErrorSeries(f"case_{nth}", 0, held, loss))
    return made


def test_the_condition_that_the_error_hangs_on_is_first_and_alone_sure() -> None:
    found = attribute(courses({"b": 1.5}))
    assert found is not None
    assert found.causes[0].conditions == ("b",)
    assert found.causes[0].is_sure
    assert found.causes[0].factor > 4
    assert sum(cause.is_sure for cause in found.causes) == 1
    assert found.explained > 0.7


def test_conditions_that_go_together_are_said_together_and_what_never_changes_apart() -> None:
    found = attribute(courses({"a": 1.0, "c": -1.0}, twin=True))
    assert found is not None
    assert {cause.conditions for cause in found.causes[:2]} == {("a", "twin"), ("c",)}
    assert next(cause.factor for cause in found.causes if cause.conditions == ("c",)) < 1
    assert found.constant == ("flat",)


def test_the_worst_segments_come_first_with_what_is_unusual_there() -> None:
    found = attribute(courses({"d": 1.5}))
    assert found is not None
    losses = [segment.loss for segment in found.segments]
    assert losses == sorted(losses, reverse=True)
    cause, factor = found.segments[0].factors[0]
    assert cause.conditions == ("d",)
    assert factor > 1.5


def test_a_trial_goes_wrong_where_its_error_leaps() -> None:
    (course,) = courses({}, trials=1)
    assert course.first_divergence is None
    loss = course.loss.copy()
    loss[40:] = 1.0
    assert ErrorSeries("c", 0, course.conditions, loss).first_divergence == 40


def test_nothing_is_learned_from_a_few_segments_or_frames_that_are_all_alike() -> None:
    assert attribute(courses({}, trials=1, frames=20)) is None
    (course,) = courses({}, trials=1)
    assert attribute([ErrorSeries("c", 0, {"flat": course.conditions["flat"]}, course.loss)]) is None


# --- Exact laws, on errors without noise ---

SEGMENTS = 40
RIDGE = 0.02  # shrinks a slope by 1 + RIDGE


def constant_in_segments(values: np.ndarray) -> np.ndarray:
    """Values of frames (N,) that are constant in each segment of 5 frames; the first frame belongs to none."""
    return np.append(values[0], np.repeat(values, 5))


def fitted(levels: dict[str, np.ndarray], log_loss: np.ndarray) -> Attribution:
    """Causes of one trial with these square roots of conditions and logarithms of the error in each segment."""
    loss = constant_in_segments(np.exp(log_loss))
    loss[0] = 0.0
    conditions = {name: constant_in_segments(level**2) for name, level in levels.items()}
    found = attribute([ErrorSeries("case", 0, conditions, loss)])
    assert found is not None
    return found


def usual_range(level: np.ndarray) -> float:
    low, high = np.percentile(level, [5, 95])
    return float(high - low)


def drawn(count: int, *, seed: int = 0) -> list[np.ndarray]:
    """Levels of `count` conditions (SEGMENTS,) that do not correlate at all, nor with a constant."""
    rng = np.random.default_rng(seed)
    basis, _ = np.linalg.qr(np.c_[np.ones(SEGMENTS), rng.standard_normal((SEGMENTS, count))])
    return [10 + 6 * basis[:, k + 1] for k in range(count)]


@pytest.mark.parametrize("slope", [0.7, -0.4])
def test_a_factor_is_what_the_error_is_multiplied_by_from_the_5th_to_the_95th_percentile(slope: float) -> None:
    level, other = drawn(2)
    found = fitted({"a": level, "b": other}, slope * (level - 10) - 4)
    first, second = found.causes
    assert first.conditions == ("a",)
    assert np.log(first.factor) * (1 + RIDGE) == pytest.approx(slope * usual_range(level), rel=1e-6)
    assert second.factor == pytest.approx(1, abs=1e-9)
    unexplained = (RIDGE / (1 + RIDGE)) ** 2
    adjusted = unexplained * (SEGMENTS - 1) / (SEGMENTS - 2 - 1)
    assert found.explained == pytest.approx(1 - adjusted, abs=1e-6)


def test_a_condition_of_few_segments_is_judged_by_its_whole_range() -> None:
    level = np.full(SEGMENTS, 1.0)
    level[7] = 3.0
    (cause,) = fitted({"a": level}, 0.5 * level - 5).causes
    assert np.log(cause.factor) * (1 + RIDGE) == pytest.approx(0.5 * 2.0, rel=1e-6)


@pytest.mark.parametrize("sign", [1, -1])
def test_correlated_conditions_are_averaged_with_the_sign_of_their_correlation(sign: int) -> None:
    level, other = drawn(2)
    follows = 20 + sign * (level - 10)
    found = fitted({"a": level, "follows": follows, "b": other}, 0.5 * level - 9)
    first, second = found.causes
    assert first.conditions == ("a", "follows")
    assert np.log(first.factor) * (1 + RIDGE) == pytest.approx(0.5 * usual_range(level), rel=1e-6)
    assert second.factor == pytest.approx(1, abs=1e-9)
    # The first of a group gives the direction: if it falls as the error rises, the factor is below 1.
    (turned, _) = fitted({"follows": follows, "a": level, "b": other}, 0.5 * level - 9).causes
    assert turned.conditions == ("follows", "a")
    assert np.log(turned.factor) == pytest.approx(sign * np.log(first.factor), rel=0.02)


@pytest.mark.parametrize(("correlation", "groups"), [(0.95, 1), (0.85, 2), (-0.95, 1), (-0.85, 2)])
def test_conditions_are_merged_from_a_correlation_of_0_9_on(correlation: float, groups: int) -> None:
    level, other = drawn(2)
    mixed = 10 + correlation * (level - 10) + np.sqrt(1 - correlation**2) * (other - 10)
    found = fitted({"a": level, "b": mixed}, 0.5 * level - 9)
    assert len(found.causes) == groups


def test_conditions_are_merged_through_a_third_one() -> None:
    level, other = drawn(2)
    between, beyond = (10 + np.cos(t) * (level - 10) + np.sin(t) * (other - 10) for t in (0.4, 0.8))
    found = fitted({"a": level, "beyond": beyond, "between": between}, 0.5 * level - 9)
    assert [cause.conditions for cause in found.causes] == [("a", "beyond", "between")]


def test_the_factors_of_a_segment_say_how_it_differs_from_the_median_one() -> None:
    a, b = drawn(2)
    found = fitted({"a": a, "b": b}, 0.8 * a - 0.3 * b - 9)
    for segment in found.segments:
        row = segment.first // 5
        expected = {
            ("a",): 0.8 * (a[row] - np.median(a)) / (1 + RIDGE),
            ("b",): -0.3 * (b[row] - np.median(b)) / (1 + RIDGE),
        }
        factors = [factor for _, factor in segment.factors]
        assert factors == sorted(factors, reverse=True)
        for cause, factor in segment.factors:
            assert np.log(factor) == pytest.approx(expected[cause.conditions], abs=1e-6)
        assert segment.loss == pytest.approx(np.exp(0.8 * a[row] - 0.3 * b[row] - 9))


def test_segments_cover_every_frame_but_the_first_once_and_belong_to_their_trial() -> None:
    trials = [
        ErrorSeries(f"case_{nth}", nth, each.conditions, each.loss) for nth, each in enumerate(courses({"a": 1.0}))
    ]
    shorter = replace(trials[0], case="short", loss=trials[0].loss[:38])
    found = attribute([*trials, shorter])
    assert found is not None
    frames: dict[str, list[int]] = {}
    for segment in found.segments:
        frames.setdefault(segment.case, []).extend(range(segment.first, segment.end))
        loss = shorter.loss if segment.case == "short" else trials[segment.repeat].loss
        assert segment.loss == pytest.approx(loss[segment.first : segment.end].mean())
    assert {case: sorted(of_case) for case, of_case in frames.items()} == {
        **{f"case_{nth}": list(range(1, 121)) for nth in range(4)},
        "short": list(range(1, 38)),
    }


def test_the_factors_of_a_case_are_the_geometric_means_of_its_segments() -> None:
    found = attribute(courses({"a": 1.0, "b": -0.5}))
    assert found is not None
    assert list(found.cases) == [f"case_{nth}" for nth in range(4)]
    for case, of_case in found.cases.items():
        for cause, factor in of_case:
            logs = [np.log(dict(segment.factors)[cause]) for segment in found.segments if segment.case == case]
            assert np.log(factor) == pytest.approx(np.mean(logs), abs=1e-9)


def test_eight_segments_are_enough_and_seven_are_not() -> None:
    rng = np.random.default_rng(1)
    for segments, is_enough in ((8, True), (7, False)):
        frames = 1 + 5 * segments
        course = ErrorSeries("c", 0, {"a": rng.uniform(0, 4, frames)}, rng.uniform(0, 1, frames))
        assert (attribute([course]) is not None) == is_enough


def test_errors_below_a_ten_thousandth_are_all_alike() -> None:
    level, _ = drawn(2)
    log_loss = np.log(1e-4) - 0.1 - 0.1 * (level - level.min())
    log_loss[:2] = np.log(0.1)  # so that there is something to explain
    smaller = log_loss - 1.0
    smaller[:2] = np.log(0.1)
    assert fitted({"a": level}, log_loss).causes[0].factor == fitted({"a": level}, smaller).causes[0].factor


@pytest.mark.parametrize(("failing", "is_answered"), [(0, False), (1, False), (2, True)])
def test_nothing_is_said_where_there_is_hardly_an_error(failing: int, is_answered: bool) -> None:
    loss = np.full(101, 0.001)
    loss[1 : 1 + 5 * failing] = 0.02
    series = ErrorSeries("c", 0, {"a": np.arange(101.0)}, loss)
    assert (attribute([series]) is not None) == is_answered
    assert ("little to explain" in reason_for_no_answer([series])) != is_answered


def test_the_reason_for_no_answer_is_a_sentence() -> None:
    assert "7 segments of 5 frames are too few" in reason_for_no_answer(courses({}, trials=1, frames=36))
    (course,) = courses({}, trials=1)
    loss = np.maximum(course.loss, 0.01)
    flat = ErrorSeries("c", 0, {"flat": course.conditions["flat"]}, loss)
    assert reason_for_no_answer([flat]) == "no condition varies in this run"
    assert reason_for_no_answer(courses({"a": 1.0})) == ""


def test_what_varies_by_rounding_alone_is_constant() -> None:
    level, _ = drawn(2)
    rounding = 3 + 1e-9 * level
    found = fitted({"a": level, "b": rounding, "zero": 0 * level}, 0.5 * level - 9)
    assert found.constant == ("b", "zero")


# --- Divergence ---


def diverging(threshold_loss: float, *, others: float) -> int | None:
    loss = np.full(50, others)
    loss[0] = 0.0
    loss[30] = threshold_loss
    return ErrorSeries("c", 0, {}, loss).first_divergence


@pytest.mark.parametrize(
    ("others", "threshold"),
    [(0.01, 0.08), (0.02, 0.16), (1e-6, 1e-4), (0.2, 0.5)],  # 8 times the median, between 1e-4 and 0.5
)
def test_a_trial_diverges_above_eight_times_its_median_error_within_limits(others: float, threshold: float) -> None:
    assert diverging(1.01 * threshold, others=others) == 30
    assert diverging(0.99 * threshold, others=others) is None


# --- Confidence intervals ---


def test_intervals_have_the_width_of_a_normal_distribution_and_cover_both_sides_alike() -> None:
    slope, sigma = 0.5, 0.3
    lower, upper, covered = [], [], []
    for seed in range(40):
        rng = np.random.default_rng(seed)
        level = np.sqrt(rng.uniform(0, 4, SEGMENTS))
        found = fitted({"a": level}, slope * level - 6 + rng.normal(0, sigma, SEGMENTS))
        (cause,) = found.causes
        reach = usual_range(level)
        sigma_of_slope = sigma / np.sqrt(SEGMENTS) / level.std()
        factor, low, high = np.log([cause.factor, cause.low, cause.high]) / reach / sigma_of_slope
        lower.append(factor - low)
        upper.append(high - factor)
        covered.append(np.log(cause.low) <= slope * reach / (1 + RIDGE) <= np.log(cause.high))
    assert np.mean(lower) == pytest.approx(1.96, rel=0.12)
    assert np.mean(upper) == pytest.approx(1.96, rel=0.12)
    assert np.mean(covered) >= 0.85


def test_an_interval_without_1_has_a_p_value_of_at_most_5_percent() -> None:
    for seed in range(5):
        for cause in attributed("coin", seed).causes + attributed("moving", seed).causes:
            excludes_1 = cause.low > 1 or cause.high < 1
            assert excludes_1 == (cause.p < 0.049) or cause.p == pytest.approx(0.05, abs=0.003)


@pytest.mark.parametrize(("p", "is_sure"), [(0.002, True), (0.05, True), (0.06, False)])
def test_a_cause_is_sure_up_to_a_corrected_p_value_of_5_percent(p: float, is_sure: bool) -> None:
    assert Cause(("a",), 2.0, 1.5, 3.0, p).is_sure == is_sure


# --- What must not pass for a cause ---


def test_p_values_are_corrected_by_the_largest_statistic_of_each_draw() -> None:
    null = np.array([[1.0, 0.0], [0.0, 3.0], [2.0, 1.0]])
    assert corrected_p_values(np.array([2.5, 0.5]), null).tolist() == [2 / 4, 4 / 4]


@pytest.mark.parametrize("kind", ["coin", "bursts"])
def test_failures_by_chance_have_no_sure_cause(kind: str) -> None:
    falsely_sure = sum(bool(attributed(kind, seed).named) for seed in range(10))
    assert falsely_sure <= 1


def test_an_error_at_a_time_of_day_has_no_sure_cause_where_all_cases_share_a_drive() -> None:
    falsely_sure = sum(bool(attributed("clock", seed).named) for seed in range(10))
    assert falsely_sure <= 1


@pytest.mark.parametrize(("kind", "condition"), [("moving", "moving"), ("blur", "blur")])
def test_a_condition_that_causes_failures_is_named(kind: str, condition: str) -> None:
    for seed in range(3):
        named = {name for cause in attributed(kind, seed).named for name in cause.conditions}
        assert condition in named
        assert named <= {condition}


def bright_spells(*spells: tuple[int, int], frames: int = 121) -> Array:
    """A condition (N,) that is 1 in some ranges of frames, and nearly 0 elsewhere."""
    values = 0.01 + 0.01 * np.random.default_rng(1).random(frames)
    for first, end in spells:
        values[first:end] = 1.0
    return values


def drive_with(condition: Array, *, name: str = "glare", drives: tuple[str, ...] = ("round",)) -> Cause:
    """What is found of a condition of the drive where the error is 30 times as large."""
    rng = np.random.default_rng(2)
    series = []
    for number in range(6):
        conditions = {name: condition, "texture": rng.uniform(1, 4, len(condition))}
        loss = 0.005 * (1 + 30 * (condition > 0.5)) * rng.uniform(0.9, 1.1, len(condition))
        drive = drives[number % len(drives)]
        series.append(ErrorSeries(f"case_{number}", 0, conditions, loss, place="hall", drive=drive))
    found = attribute(series)
    assert found is not None
    (cause,) = (cause for cause in found.causes if name in cause.conditions)
    return cause


def test_a_condition_that_agrees_with_the_error_once_on_a_single_drive_is_not_sure() -> None:
    once = bright_spells((21, 41))
    in_each_half = bright_spells((21, 31), (81, 91))
    assert drive_with(once).factor > 10
    assert not drive_with(once).recurs
    assert not drive_with(once).is_sure
    assert drive_with(in_each_half).recurs


def test_a_condition_need_not_recur_on_several_drives_nor_if_it_is_time_itself() -> None:
    once = bright_spells((21, 41))
    assert drive_with(once, drives=("round", "straight")).recurs
    late = bright_spells((61, 121))
    assert not drive_with(late).recurs
    assert drive_with(late, name="since_start").recurs


def test_a_condition_that_differs_between_cases_on_a_drive_need_not_recur() -> None:
    found = attributed("blur", 0)
    assert all(cause.recurs for cause in found.causes if "blur" in cause.conditions)


def attributed(kind: str, seed: int) -> Attribution:
    """The causes of twelve cases on one drive, with a condition of time, one of cases and one of both."""
    rng = np.random.default_rng([seed, 5])
    frames = 61
    time = np.arange(frames)
    turn = 4 + 4 * np.sin(time / 6 + rng.uniform(0, 6))
    wave = np.clip(np.sin(time / 9 + rng.uniform(0, 6)), 0, None)
    series = []
    for case in range(12):
        is_moving = rng.random() < 0.5
        blur = np.full(frames, 3.0 if case % 3 == 0 else 0.4)
        conditions = {"turn": turn, "moving": wave * is_moving + 0.001 * time / frames, "blur": blur}
        fails = {
            "coin": rng.random(frames) < 0.2,
            "bursts": np.repeat(rng.random(frames // 8 + 1) < 0.25, 8)[:frames],
            "clock": (time > 15) & (time < 27),
            "moving": conditions["moving"] > 0.3,
            "blur": blur > 1,
        }[kind]
        loss = 0.005 + 0.01 * rng.random(frames) + 0.3 * fails
        series.append(ErrorSeries(f"case_{case}", 0, conditions, loss, place="hall", drive="round"))
    found = attribute(series)
    assert found is not None
    return found
