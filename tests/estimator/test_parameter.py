"""The parameters of an estimator: all are given, none is unknown, and all are numbers."""

from dataclasses import dataclass

import pytest

from vobench.errors import VobenchError
from vobench.estimator.parameter import parameters


@dataclass(frozen=True, slots=True)
class Two:
    a: int
    b: float


def test_parameters_are_all_given_and_numbers():
    assert parameters(Two, {"a": 1, "b": 0.5}, "mine") == Two(1, 0.5)
    for wrong, said in (
        ({"a": 1}, "takes the parameters a, b"),
        ({"a": 1, "b": "x"}, "b is 'x'"),
        ({"a": True, "b": 1}, "a is"),
    ):
        with pytest.raises(VobenchError, match=said):
            parameters(Two, wrong, "mine")
