"""vobench twin: what is asked is checked before anything is read."""

import pytest


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("-e", "stand_still", "-e", "mono_vo"), "an order needs 3 estimators or more, and -e names 2"),
        (("--place", "closed"), "no scene named 'closed'. Did you mean 'closet'?"),
        (("--topic", "front=/cam0"), "no topic named 'front'"),
        (("-e", "lk_*", "-e", "{name: stereo_pnp, params: {size: 3}}"), "no parameter named 'size'"),
        (("--report", "new"), "--report takes the folder of a twin in place of a recording"),
    ],
)
def test_a_mistake_is_one_line_and_writes_nothing(vobench, ran, here, words, sentence):
    case = next((ran / "latest" / "cases").iterdir())
    said = vobench("twin", case, "--out", "new", *words)
    assert (said.code, said.out) == (1, "")
    assert sentence in said.err
    assert len(said.err.splitlines()) == 1
    assert not (here / "new").exists()


def test_a_pair_in_which_nothing_matches_is_a_sentence(vobench, ran):
    case = next((ran / "latest" / "cases").iterdir())
    said = vobench("twin", case, "--out", "new")
    assert said.code == 1
    assert "a twin needs a stereo pair" in said.err


def test_a_report_takes_the_folder_of_a_twin(vobench, here):
    said = vobench("twin", "--report", "nowhere")
    assert (said.code, said.out) == (1, "")
    assert "should be the folder of a twin, with twin.yaml in it" in said.err
    said = vobench("twin")
    assert said.code == 1
    assert "name a recording, or with --report the folder of a twin" in said.err
