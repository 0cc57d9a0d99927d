"""The estimators of a suite: parameters, limits, modes, and those that are asked for by name."""

import pytest

from vobench.errors import SuiteError, UnknownNameError


def test_a_suites_parameters_go_over_the_manifests(bent):
    assert [estimator_entry.params for estimator_entry in bent().estimator_entries] == [{}, {"measure_s": 0.1}]


def test_one_estimator_takes_part_twice_under_two_labels(bent):
    planned = bent(("stand_still,", "{name: constant_velocity, label: slow, params: {measure_s: 1}},"))
    assert [(e.label, e.params["measure_s"]) for e in planned.estimator_entries] == [
        ("slow", 1),
        ("constant_velocity", 0.1),
    ]


def test_a_suites_limits_go_over_the_manifests(bent):
    planned = bent(("stand_still,", "{name: stand_still, limits: {frame_s: 1, memory_mib: 512}},"))
    limits, usual = (estimator_entry.limits for estimator_entry in planned.estimator_entries)
    assert (limits.frame_s, limits.memory_mib, limits.start_s) == (1.0, 512, usual.start_s)
    assert usual == planned.estimator_entries[1].manifest.limits


def test_each_mode_has_an_entry_of_its_own(bent):
    planned = bent(("estimators:", "modes: [step, real_time]\nestimators:"))
    assert [(e.label, e.mode, e.claims) for e in planned.estimator_entries[:2]] == [
        ("stand_still", "step", ("baseline",)),
        ("stand_still.real_time", "real_time", ("baseline", "real time")),
    ]
    alone = bent(("estimators:", "modes: [real_time]\nestimators:"))
    assert next((e.label, e.mode) for e in alone.estimator_entries) == ("stand_still", "real_time")


@pytest.mark.parametrize(
    ("limits", "sentence"),
    [
        ("{frame_s: 0}", "limits: frame_s: should be greater than 0 (got 0"),
        ("{memory_mib: 1}", "limits: memory_mib: should be 64 or more (got 1)"),
        ("{memory_mib: 512.5}", "limits: should be a whole number (got 512.5)"),
        ("{frames: 1}", "no limit named 'frames'. Did you mean 'frame_s'?"),
    ],
)
def test_a_limit_that_is_none_is_refused_with_its_place(bent, limits, sentence):
    with pytest.raises(SuiteError) as refused:
        bent(("stand_still,", f"{{name: stand_still, limits: {limits}}},"))
    assert sentence in str(refused.value)
    assert "estimators.0" in str(refused.value)


def test_parameters_reach_an_estimator_as_plain_python(bent):
    (value,) = bent().estimator_entries[1].params.values()
    assert type(value) is float


def test_asking_for_estimators_takes_the_suites_own_settings_first(bent):
    planned = bent(only=("constant_velocity", "wheel_odometry"))
    assert [(e.label, e.params) for e in planned.estimator_entries] == [
        ("constant_velocity", {"measure_s": 0.1}),
        ("wheel_odometry", {}),
    ]


def test_asking_for_one_estimator_twice_is_an_error(bent):
    with pytest.raises(SuiteError, match="two estimators are called 'stand_still'"):
        bent(only=("stand_still", "stand_still"))


def test_asking_for_an_unknown_estimator_names_the_nearest(bent):
    with pytest.raises(UnknownNameError, match="Did you mean 'stand_still'"):
        bent(only=("stand_stil",))


def test_a_glob_asks_for_every_label_of_the_suite_that_matches(bent):
    assert [entry.label for entry in bent(only=("*st*",)).estimator_entries] == [
        "stand_still",
        "constant_velocity",
    ]
    assert [entry.label for entry in bent(only=("const*",)).estimator_entries] == ["constant_velocity"]


def test_one_mode_listed_twice_is_one_entry(bent):
    planned = bent(("estimators:", "modes: [step, step]\nestimators:"))
    assert [entry.label for entry in planned.estimator_entries] == [
        "stand_still",
        "constant_velocity",
    ]


def test_a_label_that_another_mode_has_is_refused(bent):
    with pytest.raises(SuiteError, match=r"two estimators are called 'stand_still\.real_time'"):
        bent(
            ("estimators:", "modes: [step, real_time]\nestimators:"),
            ("constant_velocity,", "constant_velocity, label: stand_still.real_time,"),
        )


@pytest.mark.parametrize(
    ("value", "is_right"), [("1", True), ("0.5", True), ("fast", False), ("[1]", False), ("true", False)]
)
def test_a_parameter_has_the_type_of_its_default_where_whole_numbers_may_be_fractions(bent, value, is_right):
    change = ("measure_s: 0.1", f"measure_s: {value}")
    if is_right:
        assert bent(change).estimator_entries[1].params == {"measure_s": float(value)}
    else:
        with pytest.raises(SuiteError, match=r"parameter 'measure_s' should be of the type of its default 1\.0, got"):
            bent(change)


def test_a_limit_that_counts_is_a_whole_number_even_if_it_is_written_as_a_fraction(bent):
    planned = bent(("stand_still,", "{name: stand_still, limits: {memory_mib: 512.0}},"))
    assert planned.estimator_entries[0].limits.memory_mib == 512
    assert isinstance(planned.estimator_entries[0].limits.memory_mib, int)


def test_a_mistake_in_a_second_estimator_names_its_place(bent, tmp_path):
    with pytest.raises(SuiteError, match=r"estimators\.1\.limits: should be a whole number \(got 99\.5\)"):
        bent(("params: {measure_s: 0.1}", "limits: {memory_mib: 99.5}"))
