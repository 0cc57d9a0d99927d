"""What errors hang on, where that is known."""

import numpy as np

from vobench.analysis.causes import Course, attribute
from vobench.geometry.se3 import Array


def courses(slope: dict[str, float], *, trials: int = 4, frames: int = 121, twin: bool = False) -> list[Course]:
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
        made.append(Course(f"case_{nth}", 0, held, loss))
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
    assert Course("c", 0, course.conditions, loss).first_divergence == 40


def test_nothing_is_learned_from_a_few_segments_or_frames_that_are_all_alike() -> None:
    assert attribute(courses({}, trials=1, frames=20)) is None
    (course,) = courses({}, trials=1)
    assert attribute([Course("c", 0, {"flat": course.conditions["flat"]}, course.loss)]) is None
