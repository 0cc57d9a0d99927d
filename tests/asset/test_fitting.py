"""Fittings: they are in front of their wall or below their ceiling, have the size asked for, and are solid."""

import numpy as np
import pytest

from tests.asset.solids import area_vectors, bounds_m, extent_m, front_agreement, is_closed, volume_m3
from vobench.asset import fitting
from vobench.asset.furniture import Part

ON_WALLS = ("door", "radiator", "socket", "skirting", "framed", "noticeboard", "pipe", "curtain")
OTHERS = ("window_frame", "blind", "glass_wall", "lamp_housing", "spot_housing")
# The size along x, y and z that follows from the arguments; NaN if none follows.
SIZED = {
    "door": ({"width_m": 1.2, "height_m": 2.3}, (np.nan, 1.2 + 0.14, 2.3 + 0.07)),
    "window_frame": ({"width_m": 2.0, "height_m": 1.1, "depth_m": 0.2}, (np.nan, 2.1, np.nan)),
    "blind": ({"width_m": 1.2}, (np.nan, 1.2, np.nan)),
    "curtain": ({"width_m": 0.8, "height_m": 2.2}, (np.nan, 0.8, 2.2)),
    "skirting": ({"length_m": 3.0, "height_m": 0.1}, (0.014, 3.0, 0.1)),
    "framed": ({"width_m": 0.4, "height_m": 0.3}, (np.nan, 0.45, 0.35)),
    "noticeboard": ({"width_m": 0.8, "height_m": 0.6}, (np.nan, 0.85, 0.65)),
    "glass_wall": ({"width_m": 2.0, "height_m": 2.5}, (0.03, 2.06, 2.5)),
    "pipe": ({"length_m": 3.0, "radius_m": 0.05}, (np.nan, 3.0, 2.7 * 0.05)),
    "socket": ({"count": 3}, (np.nan, 3 * 0.072 + 0.012, 0.082)),
}


def made(kind, seed=0, **size):
    return getattr(fitting, kind)(np.random.default_rng(seed), **size)


@pytest.mark.parametrize("kind", SIZED)
def test_a_fitting_has_the_size_that_was_asked_for(kind):
    size, expected_m = SIZED[kind]
    actual_m = extent_m(made(kind, **size))
    is_given = np.isfinite(expected_m)
    np.testing.assert_allclose(actual_m[is_given], np.array(expected_m)[is_given], atol=0.003)


@pytest.mark.parametrize("kind", ON_WALLS)
def test_a_fitting_is_in_front_of_its_wall_and_close_to_it(kind):
    lowest_m, _ = bounds_m(made(kind))
    assert 0 <= lowest_m[0] < 0.06


@pytest.mark.parametrize("kind", [*ON_WALLS, *OTHERS])
def test_closed_parts_are_not_inside_out_and_the_front_of_each_face_is_that_of_its_normals(kind):
    for part in made(kind):
        assert front_agreement(part).min() > 0
        if is_closed(part) and kind != "curtain":
            assert volume_m3(part) > 0


def test_a_curtain_has_two_sides_and_hangs_from_its_rail():
    (curtain,) = made("curtain", height_m=1.5)
    assert volume_m3(curtain) == pytest.approx(0, abs=1e-12)
    lowest_m, highest_m = bounds_m([curtain])
    assert highest_m[2] == pytest.approx(0)
    assert lowest_m[2] == pytest.approx(-1.5)


def test_bars_leave_their_rectangle_free_and_touch_it_on_all_four_sides():
    vertices_m = fitting.bars(0.6, 0.4, 0.05, 0.02).vertices
    is_inside = (np.abs(vertices_m[:, 1]) < 0.3 - 1e-9) & (np.abs(vertices_m[:, 2]) < 0.2 - 1e-9)
    assert not is_inside.any()
    for axis, half_m in ((1, 0.3), (2, 0.2)):
        for side in (-1, 1):
            assert np.isclose(vertices_m[:, axis], side * half_m).any()
            assert (side * vertices_m[:, axis]).max() == pytest.approx(half_m + 0.05)


def test_bars_enclose_the_volume_of_four_blocks():
    sharp = fitting.bars(0.6, 0.4, 0.05, 0.02, bevel_m=0)
    area_m2 = 0.7 * 0.5 - 0.6 * 0.4
    assert volume_m3(Part(sharp, fitting.PANE)) == pytest.approx(0.02 * area_m2)


def test_the_sign_of_a_door_faces_the_room_and_its_handle_and_hinges_are_on_opposite_sides():
    _, _, *hinges, _, handle, sign = made("door")
    np.testing.assert_allclose(area_vectors(sign)[:, 1:], 0, atol=1e-12)
    assert area_vectors(sign)[:, 0].min() > 0
    assert all(bounds_m([hinge])[1][1] < 0 for hinge in hinges)
    assert bounds_m([handle])[0][1] > 0


def test_a_window_is_as_far_behind_its_wall_as_it_says():
    for depth_m in (0.1, 0.3):
        frame, _, sill = made("window_frame", depth_m=depth_m)
        lowest_m, highest_m = bounds_m([frame])
        assert (lowest_m[0] + highest_m[0]) / 2 == pytest.approx(0.035 - depth_m)
        assert bounds_m([sill])[0][0] <= lowest_m[0] + 0.04
        assert bounds_m([sill])[1][0] > 0


def test_the_slats_of_a_blind_are_as_many_as_its_drop_has_room_for_and_all_in_it():
    for drop_m in (0.5, 1.0):
        slats, _, _ = made("blind", drop_m=drop_m, slat_deg=0.0)
        lowest_m, highest_m = bounds_m([slats])
        assert -drop_m - 0.05 < lowest_m[2] < -drop_m + 0.05
        assert highest_m[2] < 0
        count = len(slats.arrays.faces) / len(made("blind", drop_m=0.05)[0].arrays.faces)
        assert count == drop_m // 0.042


def test_slats_are_tilted_by_their_angle():
    def depth_m(slat_deg):
        return extent_m([made("blind", slat_deg=slat_deg)[0]])[0]

    assert depth_m(0.0) == pytest.approx(0.05, abs=0.001)
    assert depth_m(60.0) == pytest.approx(0.05 * np.cos(np.deg2rad(60)), abs=0.005)


def test_a_wider_radiator_has_more_columns_and_its_pipe_goes_into_the_floor():
    narrow, wide = made("radiator", width_m=0.7), made("radiator", width_m=1.4)
    assert len(wide[0].arrays.faces) > 1.8 * len(narrow[0].arrays.faces)
    assert bounds_m([wide[1]])[0][2] == pytest.approx(0, abs=0.003)


@pytest.mark.parametrize("count", [1, 2, 4])
def test_a_plate_has_one_outlet_with_two_pins_for_each_of_its_count(count):
    _, *outlets_and_pins = made("socket", count=count)
    assert len(outlets_and_pins) == 3 * count
    mean_y_m = np.mean([part.arrays.vertices_m[:, 1].mean() for part in outlets_and_pins])
    assert mean_y_m == pytest.approx(0, abs=1e-9)


def test_a_picture_is_painted_in_the_proportions_of_its_frame():
    for width_m, height_m in ((0.5, 0.7), (0.9, 0.3)):
        face, _ = made("framed", width_m=width_m, height_m=height_m)
        height_px, width_px, _ = face.material.texture.pixels().shape
        assert width_px / height_px == pytest.approx(width_m / height_m, rel=0.01)
        assert max(width_px, height_px) == 900


def test_a_mirror_is_framed_without_a_picture():
    face, _ = made("framed", style="mirror")
    assert face.material is fitting.MIRROR
    assert face.material.texture is None


def test_papers_lie_on_their_board_one_over_the_other_and_each_has_a_pin():
    cork, _, sheets, pins = made("noticeboard", width_m=1.0, height_m=0.8)
    count = int(1.0 * 0.8 * 9)
    assert len(sheets.arrays.faces) == 2 * count
    x_m = np.unique(np.round(sheets.arrays.vertices_m[:, 0], 6))
    assert len(x_m) == count
    assert x_m[0] > bounds_m([cork])[1][0]
    lowest_m, highest_m = bounds_m([sheets])
    assert np.abs([lowest_m[1:], highest_m[1:]]).max() < 0.55
    assert len(pins.arrays.faces) % count == 0


def test_a_pane_of_a_glass_wall_reaches_from_bar_to_bar():
    pane, frame = made("glass_wall", width_m=1.6, height_m=2.2)
    np.testing.assert_allclose(extent_m([frame])[1:] - extent_m([pane])[1:], 0.06, atol=1e-9)
    assert pane.material.kind == "pane"


@pytest.mark.parametrize("radius_m", [0.02, 0.05])
def test_a_pipe_is_six_centimetres_off_its_wall_whatever_its_radius(radius_m):
    (pipe,) = made("pipe", radius_m=radius_m, length_m=0.6)
    vertices_m = pipe.arrays.vertices_m
    is_end = np.isclose(np.abs(vertices_m[:, 1]), 0.3)
    assert vertices_m[is_end, 0].min() == pytest.approx(0.06, abs=0.001)
    assert vertices_m[is_end, 0].max() == pytest.approx(0.06 + 2 * radius_m, abs=0.001)


def test_a_housing_is_above_its_light_and_its_rods_reach_the_ceiling():
    tray, rods = made("lamp_housing", size_m=(0.6, 0.4), hang_m=0.5)
    assert bounds_m([tray])[0][2] > 0
    np.testing.assert_allclose(extent_m([tray])[:2], [0.63, 0.43])
    assert bounds_m([rods])[1][2] == pytest.approx(0.5)


def test_the_housing_of_a_spot_is_behind_its_light():
    _, highest_m = bounds_m(made("spot_housing"))
    assert highest_m[0] < 0
