"""The sentences of errors."""

import pytest

from vobench.errors import VobenchError, enumerated, error_sentence


def test_the_sentence_about_an_exception_names_its_type_unless_vobench_raised_it():
    assert error_sentence(ValueError("a\nb")) == "ValueError: a b"
    assert error_sentence(VobenchError("needs\nwheels")) == "needs wheels"


@pytest.mark.parametrize(
    ("count", "said"), [(1, "a0"), (3, "a0, a1, a2"), (4, "a0, a1, a2 and 1 more"), (9, "a0, a1, a2 and 6 more")]
)
def test_long_lists_of_names_end_with_how_many_more_there_are(count, said):
    assert enumerated([f"a{index}" for index in range(count)], 3) == said
