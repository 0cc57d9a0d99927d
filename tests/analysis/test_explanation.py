"""What a set of changes names as the cause of a failure."""

from dataclasses import replace

import pytest

from tests.analysis.changes import change
from vobench.analysis.explanation import Explanation, is_sufficient


@pytest.mark.parametrize(
    ("reduction", "is_sure", "is_enough"), [(0.61, True, True), (0.59, True, False), (0.9, False, False)]
)
def test_a_change_is_sufficient_if_it_surely_achieves_two_thirds_of_everything(reduction, is_sure, is_enough) -> None:
    of_blur = change("blur", reduction=reduction, is_sure=is_sure)
    assert is_sufficient(of_blur, change("all", reduction=0.9)) == is_enough


@pytest.mark.parametrize(("reduction", "is_enough"), [(0.51, True), (0.49, False)])
def test_where_removing_all_does_not_help_half_of_the_error_is_sufficient(reduction: float, is_enough: bool) -> None:
    for everything in (change("all", is_sure=False), None):
        assert is_sufficient(change("blur", reduction=reduction), everything) == is_enough


def test_nothing_is_sure_from_the_seeds_that_it_was_selected_with() -> None:
    assert change("blur").is_sure
    assert not replace(change("blur"), is_confirmed=False).is_sure
    assert change("blur", reduction=-0.2).is_harmful
    assert not replace(change("blur", reduction=-0.2), is_confirmed=False).is_harmful
    assert not change("blur", reduction=-0.05).is_harmful


def explanation(**parts) -> Explanation:
    given = {
        "loss": 0.5,
        "status": "lost",
        "repeats_differ": True,
        "everything": change("blur", "noise", "gloss", reduction=0.9),
        "singles": (change("blur", reduction=0.3), change("noise", reduction=0.2)),
        "alone": {},
        "pairs": (change("noise", "gloss", reduction=0.7), change("blur", "noise", reduction=0.35)),
        "trials": 40,
    }
    return Explanation(**{**given, **parts})


@pytest.mark.parametrize(
    ("parts", "relation", "named"),
    [
        ({}, "together", ("noise", "gloss")),
        ({"everything": change("all", reduction=0.9, is_sure=False), "pairs": ()}, "none", ()),
        ({"singles": (change("blur", reduction=0.7),)}, "one", ("blur",)),
        ({"singles": (change("blur", reduction=0.3, is_sure=False),), "pairs": ()}, "none", ()),
        ({"singles": (change("blur", reduction=0.55),), "pairs": ()}, "one", ("blur",)),
        ({"pairs": ()}, "none", ()),
        ({"pairs": (change("noise", "gloss", reduction=0.7, is_sure=False),)}, "none", ()),
        ({"singles": (change("noise", reduction=0.58),)}, "one", ("noise",)),  # the pair gains 12 % more
        ({"singles": (change("noise", reduction=0.54),)}, "together", ("noise", "gloss")),
        ({"singles": (change("blur", reduction=0.8), change("noise", reduction=0.7))}, "either", ("blur",)),
    ],
)
def test_what_is_named_explains_most_and_is_sure(parts, relation, named) -> None:
    found = explanation(**parts)
    assert (found.relation, found.named) == (relation, named)
