"""Which trials and frames vobench view shows."""

import pytest

from vobench.cli.view import TrialSelection
from vobench.errors import InputError


@pytest.mark.parametrize(
    ("frames", "window"),
    [
        (None, slice(None, None)),
        (":", slice(None, None)),
        ("40:80", slice(40, 80)),
        ("40:", slice(40, None)),
        (":80", slice(None, 80)),
        ("0:1", slice(0, 1)),
    ],
)
def test_frames_are_a_window_whose_ends_may_be_left_out(frames, window):
    assert TrialSelection(frames=frames).window() == window


@pytest.mark.parametrize("frames", ["40", "a:80", "40:b", "-1:3", "1:2:3", "1.5:2"])
def test_frames_of_another_form_are_refused_with_an_example(frames):
    with pytest.raises(InputError, match=r"^--frames should be A:B, two frame numbers, as in 40:80 \(got "):
        TrialSelection(frames=frames).window()


@pytest.mark.parametrize(("options", "is_right"), [({}, True), ({"estimator": "a"}, False), ({"worst": 2}, False)])
def test_compare_names_its_estimators_itself(options, is_right):
    selection = TrialSelection(compare=("a", "b"), **options)
    if is_right:
        selection.require_consistent()
    else:
        with pytest.raises(InputError, match="remove --estimator and --worst"):
            selection.require_consistent()
    TrialSelection(**options).require_consistent()
