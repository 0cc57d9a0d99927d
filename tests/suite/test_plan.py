"""The trials of a plan, and the plan of a selection of cases."""

import pytest

from vobench.errors import UnknownNameError


def test_every_estimator_runs_repeats_times_on_every_case(bent):
    planned = bent(("seed: 1", "seed: 1\nrepeats: 3"))
    runs = [run for case in planned.cases for run in planned.trials(case)]
    assert len(runs) == len({(run.case.name, run.estimator_entry.label, run.repeat) for run in runs}) == 2 * 2 * 3


MORE = ("{clean: {sensor: clean}}", "{clean: {sensor: clean}, noisy: {sensor: mt9v034}}")


def names(plan):
    return [case.name for case in plan.cases]


def test_without_patterns_all_cases_remain(bent):
    plan = bent(MORE)
    assert names(plan) == ["full-clean", "full-noisy", "dim-clean", "dim-noisy"]
    assert plan.only((), ()) == plan


@pytest.mark.parametrize(
    ("cases", "selected"),
    [
        (("full-*",), ["full-clean", "full-noisy"]),
        (("*-noisy",), ["full-noisy", "dim-noisy"]),
        (("full-clean", "dim-noisy"), ["full-clean", "dim-noisy"]),
        (("full-*", "*-noisy"), ["full-clean", "full-noisy", "dim-noisy"]),
    ],
)
def test_a_case_is_selected_if_any_of_the_patterns_matches(bent, cases, selected):
    assert names(bent(MORE).only(cases, ())) == selected


@pytest.fixture
def two_scenes(bent, tmp_path):
    """A plan with the scenes closet and hall and two lightings of each."""
    bent()
    closet = (tmp_path / "scenes" / "closet.yaml").read_text()
    (tmp_path / "scenes" / "hall.yaml").write_text(closet.replace("name: closet", "name: hall"))
    return bent(("[closet]", "[closet, hall]"))


@pytest.mark.parametrize(
    ("cases", "scenes", "selected"),
    [
        ((), ("hall",), ["hall-full", "hall-dim"]),
        ((), ("hall", "clos*"), ["closet-full", "closet-dim", "hall-full", "hall-dim"]),
        (("*-dim",), ("hall",), ["hall-dim"]),
        (("closet-*",), ("hall",), []),
    ],
)
def test_a_case_has_to_match_a_case_pattern_and_a_scene_pattern(two_scenes, cases, scenes, selected):
    assert names(two_scenes.only(cases, scenes)) == selected


@pytest.mark.parametrize(
    ("cases", "scenes", "sentence"),
    [
        (("full", "bright"), (), "no case named 'bright'. Known: dim, full"),
        (("dimm",), (), "no case named 'dimm'. Did you mean 'dim'? Known: dim, full"),
        ((), ("attic",), "no scene named 'attic'. Known: closet"),
    ],
)
def test_a_pattern_without_a_match_is_refused_with_the_known_names(bent, cases, scenes, sentence):
    with pytest.raises(UnknownNameError) as refused:
        bent().only(cases, scenes)
    assert str(refused.value) == sentence


def test_limits_replace_those_of_every_estimator_and_no_others(bent):
    plan = bent(("stand_still,", "{name: stand_still, limits: {frame_s: 1}},"))
    limited = plan.limited(memory_mib=99)
    for before, after in zip(plan.estimator_entries, limited.estimator_entries, strict=True):
        assert after.limits.memory_mib == 99
        assert after.limits.frame_s == before.limits.frame_s
        assert after.params == before.params


def test_trials_count_their_repeats_from_0_and_have_a_name(bent):
    plan = bent(("seed: 1", "seed: 1\nrepeats: 2"))
    trials = plan.trials(plan.cases[0])
    assert [trial.repeat for trial in trials] == [0, 1, 0, 1]
    assert trials[0].name == "stand_still on full"


def test_mistakes_in_a_plan_begin_with_none(bent):
    plan = bent()
    assert plan.mistakes().found == []
    assert plan.mistakes().source is plan.source
