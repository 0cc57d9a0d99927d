"""A bundle is scored again, and its scores are compared with its own."""


def test_a_bundle_is_scored_again_with_the_command_that_bundle_prints(vobench, ran, here):
    printed = vobench("bundle", ran, "tiny.zip").out
    assert printed.endswith("score it again: vobench score tiny.zip\n")
    said = vobench("score", "tiny.zip")
    assert (said.code, said.err) == (0, "")
    assert "2 of 2 scores are the same as in the bundle" in said.out
    assert vobench("score", "tiny.zip", "--json").json == {"trials": 2, "differ": []}
