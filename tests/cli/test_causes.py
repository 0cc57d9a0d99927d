"""What vobench causes prints of an attribution."""

from types import SimpleNamespace

import pytest

from vobench.analysis.conditions import CONDITIONS
from vobench.cli import causes as cli_causes
from vobench.cli import terminal


def cause(*conditions, factor=2.0, is_sure=True, recurs=True):
    return SimpleNamespace(
        conditions=conditions, factor=factor, low=1.5, high=2.5, is_sure=is_sure and recurs, recurs=recurs
    )


def attribution(*causes, constant=(), segments=()):
    cases = {"dark": [(each, each.factor) for each in causes]}
    return SimpleNamespace(
        causes=causes,
        named=causes,
        explained=0.734,
        is_mostly_unexplained=False,
        constant=constant,
        cases=cases,
        segments=segments,
    )


def test_a_cause_that_is_not_significant_says_so():
    assert cli_causes._cause_row(cause("speed", "turn")) == ["speed + turn", "2", "1.5 to 2.5", "significant"]
    assert cli_causes._cause_row(cause("speed", is_sure=False))[-1] == "not significant"
    assert cli_causes._cause_row(cause("speed", recurs=False))[-1] == "not in each half"


@pytest.mark.parametrize(
    ("factors", "text"),
    [
        ([], ""),
        ([1.1], ""),
        ([1.11], "c0 ×1.1"),
        ([3.0, 0.5, 2.0], "c0 ×3, c2 ×2"),
        ([5.0, 4.0, 3.0, 2.0], "c0 ×5, c1 ×4, c2 ×3"),
    ],
)
def test_the_three_largest_factors_above_a_tenth_are_named(factors, text):
    pairs = [(cause(f"c{number}"), factor) for number, factor in enumerate(factors)]
    assert cli_causes._largest_factors(pairs) == text


def test_a_trial_has_the_frame_at_which_it_diverges_if_it_does():
    rows = [
        {"case": "dark", "repeat": 0, "status": "ok", "first_divergence_frame": None},
        {"case": "dark", "repeat": 1, "status": "diverged", "first_divergence_frame": 0},
    ]
    trials = SimpleNamespace(trials=lambda: rows)
    assert cli_causes._trial_rows(trials, attribution(cause("speed"))) == [
        ["dark", "ok", "", "speed ×2"],
        ["dark/1", "diverged", "0", "speed ×2"],
    ]


def test_so_many_of_the_worst_segments_are_listed_with_their_last_frame():
    segments = [
        SimpleNamespace(case="dark", repeat=0, first=10 * n, end=10 * n + 10, loss=0.123, factors=[]) for n in range(3)
    ]
    rows = cli_causes._segment_rows(attribution(segments=segments), 2)
    assert rows == [["dark", "0 to 9", "12.3%", ""], ["dark", "10 to 19", "12.3%", ""]]


@pytest.mark.parametrize(
    ("causes", "constant", "are_joined", "is_constant"),
    [
        ((cause("blur"),), (), False, False),
        ((cause("blur"), cause("turn", "flow")), (), True, False),
        ((cause("turn", "flow"),), ("gain",), True, True),
    ],
)
def test_what_cannot_be_separated_or_known_is_said(capsys, causes, constant, are_joined, is_constant):
    cli_causes._print_attribution("lk", attribution(*causes, constant=constant), terminal.console())
    printed = capsys.readouterr().out
    assert "All conditions explain 73% of the variance" in printed
    assert ("a regression cannot separate them" in printed) is are_joined
    assert ("Unknown, because constant in all segments: gain" in printed) is is_constant


@pytest.mark.parametrize(
    ("causes", "is_mostly_unexplained", "sentence"),
    [
        ((cause("blur", factor=120.4),), False, "lk: the error depends on blur ×120 (95 % interval 1.5 to 2.5)."),
        ((), False, "lk: the error depends significantly on none of the conditions."),
        ((cause("blur"),), True, "lk: most of the error has a cause that is not among the conditions"),
    ],
)
def test_causes_are_named_unless_most_of_the_error_is_unexplained(capsys, causes, is_mostly_unexplained, sentence):
    found = attribution(*causes)
    found.is_mostly_unexplained = is_mostly_unexplained
    cli_causes._print_attribution("lk", found, terminal.console())
    assert capsys.readouterr().out.startswith(sentence)


def test_named_conditions_are_described(capsys):
    cli_causes._print_attribution("lk", attribution(cause("blur"), cause("turn", "flow")), terminal.console())
    lines = capsys.readouterr().out.splitlines()
    assert lines[1:4] == [f"- {name}: {CONDITIONS[name][1]}" for name in ("blur", "turn", "flow")]


def test_few_of_many_conditions_that_vary_together_are_named_beside_a_trial():
    assert cli_causes._with_factor(cause("a", "b"), 2) == "a + b ×2"
    assert cli_causes._with_factor(cause("a", "b", "c", "d"), 2.345) == "a + b + 2 more ×2.3"


def test_without_an_attribution_only_the_reason_is_printed(capsys):
    refused = SimpleNamespace(estimator="lk", attribution=None, reason="it is a baseline")
    cli_causes._print_causes(refused, worst=3)
    assert capsys.readouterr().out == "lk: no answer. it is a baseline\n\n"
