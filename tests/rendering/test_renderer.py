"""The engines have the interface of a renderer, and a picture at one instant is one view."""

import inspect

import numpy as np
import pytest

from vobench.geometry.camera import Pinhole
from vobench.rendering.path import PathRenderer
from vobench.rendering.raster import RasterRenderer
from vobench.rendering.renderer import Renderer, single_instant

CAMERA = Pinhole(6, 4, 5.0, 5.0, 2.5, 1.5)


def test_a_picture_at_one_instant_is_one_view_of_all_rows_and_one_sub_frame() -> None:
    T_world_camera = np.eye(4)
    T_world_camera[:3, 3] = [1, 2, 3]
    (view,) = single_instant(CAMERA, T_world_camera, t_ns=7)
    assert view.rows == slice(0, 4)
    assert view.start_ns.tolist() == view.end_ns.tolist() == [7]
    assert view.start_ns.dtype == np.int64
    np.testing.assert_array_equal(view.T_world_camera, T_world_camera[None])


@pytest.mark.parametrize("engine", [RasterRenderer, PathRenderer])
def test_engines_take_what_the_protocol_says(engine: type) -> None:
    for name in ("radiance", "close"):
        expected = inspect.signature(getattr(Renderer, name)).parameters
        actual = inspect.signature(getattr(engine, name)).parameters
        assert [*actual] == [*expected]
        for parameter in expected:
            assert actual[parameter].default == expected[parameter].default
            assert actual[parameter].kind == expected[parameter].kind
