"""The trials of a plan, and the plan of a selection of cases."""

import pytest

from vobench.errors import UnknownNameError

REPEATED = ("seed: 1", "seed: 1\nrepeats: 3")


def trials_of(plan):
    return [(run.case.name, run.estimator_entry.label, run.repeat) for case in plan.cases for run in plan.trials(case)]


def test_a_repeat_is_a_case_with_new_noise_and_another_seed_of_the_estimator(bent):
    plan = bent(REPEATED)
    assert names(plan) == [f"{name}{copy}" for name in ("full", "dim") for copy in ("", "-repeat2", "-repeat3")]
    assert len({case.seed for case in plan.cases}) == 3
    assert {(case, repeat) for case, _, repeat in trials_of(plan)} >= {("dim", 0), ("dim-repeat2", 1)}


def test_deterministic_estimators_answer_the_first_case_twice_and_every_other_once(bent):
    once = trials_of(bent())
    repeated = trials_of(bent(REPEATED))
    again = {("full", label, 1) for _, label, _ in once}
    assert len(repeated) == len(set(repeated)) == 3 * len(once) + len(again)
    assert again <= set(repeated)


def test_the_name_of_a_case_selects_its_repeats(bent):
    plan = bent(REPEATED)
    assert names(plan.only(("dim",), ())) == ["dim", "dim-repeat2", "dim-repeat3"]
    assert names(plan.only(("dim-repeat2",), ())) == ["dim-repeat2"]


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


def test_trials_have_the_names_of_their_estimator_and_case(bent):
    plan = bent()
    assert plan.trials(plan.cases[0])[0].name == "stand_still on full"


def test_mistakes_in_a_plan_begin_with_none(bent):
    plan = bent()
    assert plan.mistakes().recorded == []
    assert plan.mistakes().source is plan.source
