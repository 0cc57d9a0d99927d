"""The sentences of errors."""

from vobench.errors import VobenchError, error_sentence


def test_the_sentence_about_an_exception_names_its_type_unless_vobench_raised_it():
    assert error_sentence(ValueError("a\nb")) == "ValueError: a b"
    assert error_sentence(VobenchError("needs\nwheels")) == "needs wheels"
