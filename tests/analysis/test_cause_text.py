"""The words about causes."""

import pytest

from vobench.analysis.cause_text import CAUSE_TEXTS
from vobench.analysis.nuisance import NUISANCES


def test_every_nuisance_and_part_has_words_and_no_words_are_left_over() -> None:
    names = [nuisance.name for nuisance in NUISANCES]
    names += [part.name for nuisance in NUISANCES for part in nuisance.parts]
    assert sorted(names) == sorted(CAUSE_TEXTS)


@pytest.mark.parametrize("name", CAUSE_TEXTS)
def test_the_words_fit_into_a_sentence(name: str) -> None:
    text = CAUSE_TEXTS[name]
    for part in (text.because, text.advice):
        assert not part.endswith(".")
        first = part.split()[0]
        assert first == "IMU" or first.islower(), part
