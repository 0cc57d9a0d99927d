"""A picture of a scene is rendered from Python with the options of the command."""

import inspect

import numpy as np
import pytest

import vobench
from vobench.errors import InputError
from vobench.runner.scene_picture import render_scene


def test_a_picture_of_a_scene_is_an_array(here):
    picture = vobench.render("closet", at_m=(0, 0, 1), camera="paper_blender")
    assert picture.shape[2] == 3
    assert picture.dtype == np.uint8
    with pytest.raises(InputError, match="should be inside the room"):
        vobench.render("closet", at_m=(5, 0, 1))


def test_options_have_the_defaults_of_the_command():
    shown = inspect.signature(vobench.render).parameters
    used = inspect.signature(render_scene).parameters
    assert set(used) - set(shown) == {"with_truth", "progress"}
    assert {name: shown[name].default for name in shown} == {name: used[name].default for name in shown}
