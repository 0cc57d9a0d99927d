"""Furniture for homes: it has the size that was asked for, stands on the floor, is solid, and faces x."""

import numpy as np
import pytest

from tests.asset.solids import area_vectors, bounds_m, extent_m, front_agreement, is_closed, volume_m3
from vobench.asset import household
from vobench.scene.material import emitted_cd_m2

PIECES = ("table", "dining_chair", "rug", "television", "floor_lamp", "pendant", "fruit_bowl", "low_board")
# The size along x, y and z that follows from the arguments; NaN if none follows.
SIZED = {
    "table": ({"depth_m": 0.9, "width_m": 1.9, "height_m": 0.7}, (0.9, 1.9, 0.7)),
    "rug": ({"depth_m": 1.1, "width_m": 3.0}, (1.1, 3.0, np.nan)),
    "television": ({"width_m": 1.6}, (np.nan, 1.6, 0.04 + 0.57 * 1.6)),
    "floor_lamp": ({"height_m": 1.9, "wide_m": 0.5}, (0.5, 0.5, 1.9)),
    "pendant": ({"drop_m": 1.4, "wide_m": 0.6}, (0.6, 0.6, 1.4)),
    "low_board": ({"depth_m": 0.5, "width_m": 2.2, "height_m": 0.6}, (np.nan, 2.2, 0.6)),
}


def made(kind, seed=0, **size):
    return getattr(household, kind)(np.random.default_rng(seed), **size)


@pytest.mark.parametrize("kind", SIZED)
def test_a_piece_has_the_size_that_was_asked_for(kind):
    size, expected_m = SIZED[kind]
    actual_m = extent_m(made(kind, **size))
    is_given = np.isfinite(expected_m)
    np.testing.assert_allclose(actual_m[is_given], np.array(expected_m)[is_given], atol=0.003)


@pytest.mark.parametrize("kind", [kind for kind in PIECES if kind != "pendant"])
def test_a_piece_stands_on_the_floor(kind):
    lowest_m, _ = bounds_m(made(kind))
    assert lowest_m[2] == pytest.approx(0, abs=0.004)


def test_a_pendant_hangs_below_its_ceiling():
    lowest_m, highest_m = bounds_m(made("pendant", drop_m=0.7))
    assert lowest_m[2] == pytest.approx(-0.7)
    assert highest_m[2] == pytest.approx(0)


@pytest.mark.parametrize("kind", PIECES)
def test_a_piece_is_as_wide_to_its_left_as_to_its_right(kind):
    lowest_m, highest_m = bounds_m(made(kind))
    assert highest_m[1] == pytest.approx(-lowest_m[1])


@pytest.mark.parametrize("kind", PIECES)
def test_closed_parts_are_not_inside_out_and_the_front_of_each_face_is_that_of_its_normals(kind):
    for part in made(kind):
        assert front_agreement(part).min() > 0
        if is_closed(part):
            assert volume_m3(part) > 0


@pytest.mark.parametrize("kind", ["table", "dining_chair", "fruit_bowl", "low_board"])
def test_furniture_without_pictures_or_shades_is_solid(kind):
    assert all(is_closed(part) for part in made(kind))


def test_a_table_has_four_legs_of_its_height_under_its_top():
    parts = made("table", width_m=1.6, depth_m=0.8, height_m=0.72)
    legs = [part for part in parts if extent_m([part])[2] > 0.6]
    assert len(legs) == 4
    centers = {tuple(np.sign(part.arrays.vertices_m.mean(axis=0)[:2]).tolist()) for part in legs}
    assert centers == {(-1, -1), (-1, 1), (1, -1), (1, 1)}
    top = parts[-1]
    assert bounds_m(legs)[1][2] == pytest.approx(bounds_m([top])[0][2])


def test_the_back_of_a_chair_is_behind_its_seat_so_that_a_person_looks_along_x():
    legs_and_back, rails, seat, pad = made("dining_chair")
    assert bounds_m([rails])[1][0] < bounds_m([pad])[0][0] + 0.02
    assert bounds_m([rails])[0][2] > bounds_m([pad])[1][2]
    assert bounds_m([seat])[0][2] == pytest.approx(0.425)
    assert bounds_m([legs_and_back])[1][2] > 0.8


@pytest.mark.parametrize(("kind", "towards"), [("television", (1, 0, 0)), ("rug", (0, 0, 1))])
def test_what_shows_a_picture_shows_it_to_the_front_or_upwards(kind, towards):
    pictured = made(kind)[-1]
    directions = area_vectors(pictured) @ towards
    areas = np.linalg.norm(area_vectors(pictured), axis=1)
    np.testing.assert_allclose(directions, areas)
    assert bounds_m([pictured])[1] @ towards == pytest.approx(bounds_m(made(kind))[1] @ towards, abs=0.12)


def test_a_television_gives_light_and_is_dark_without_it():
    screen = made("television")[-1]
    assert emitted_cd_m2(screen.material).max() > 0
    assert max(screen.material.colour) < 0.05


def test_a_shade_is_open_at_both_ends_and_its_inside_faces_inwards():
    outer, inner = made("floor_lamp")[-2:]
    for part, sign in ((outer, 1), (inner, -1)):
        mesh = part.arrays
        outwards = mesh.corners_m.mean(axis=1) * [1, 1, 0]
        assert (sign * (area_vectors(part) * outwards).sum(axis=1)).min() > 0
    assert not is_closed(outer)
    assert extent_m([inner])[0] < extent_m([outer])[0]


def test_a_shade_becomes_narrower_upwards():
    vertices_m = made("floor_lamp")[-2].arrays.vertices_m
    radius_m = np.hypot(vertices_m[:, 0], vertices_m[:, 1])
    is_top = vertices_m[:, 2] > vertices_m[:, 2].mean()
    assert radius_m[is_top].max() < radius_m[~is_top].min()


def test_a_bulb_is_a_ball_at_its_place():
    mesh = household.bulb(1.0, -2.0, 3.0, width_m=0.1)
    distances_m = np.linalg.norm(mesh.vertices - [1.0, -2.0, 3.0], axis=1)
    np.testing.assert_allclose(distances_m, 0.05, rtol=1e-6)
    assert 0.75 < mesh.volume / (4 / 3 * np.pi * 0.05**3) < 1


def test_fruit_lies_inside_of_its_bowl_and_one_lies_on_top():
    bowl, *fruit = made("fruit_bowl")
    rim_m = extent_m([bowl])[0] / 2
    centers_m = np.array([part.arrays.vertices_m.mean(axis=0) for part in fruit])
    assert np.hypot(*centers_m[:, :2].T).max() < rim_m
    assert len(fruit) == 7
    assert np.count_nonzero(centers_m[:, 2] > 0.1) == 1


def test_the_doors_of_a_low_board_are_at_its_front_and_the_middle_bay_is_open():
    parts = made("low_board", width_m=2.1)
    front_m = bounds_m(parts)[1][0]
    doors = [part for part in parts if extent_m([part])[0] < 0.02 and bounds_m([part])[0][0] > 0]
    assert len(doors) == 2
    for door in doors:
        lowest_m, highest_m = bounds_m([door])
        assert highest_m[0] == pytest.approx(front_m, abs=0.03)
        assert min(abs(lowest_m[1]), abs(highest_m[1])) >= 2.1 / 6


@pytest.mark.parametrize("kind", ["pendant", "fruit_bowl", "table", "low_board"])
def test_a_seed_makes_the_same_piece_again_and_another_seed_another_piece(kind):
    def figures(seed):
        parts = made(kind, seed)
        texture = sum(float(part.arrays.uv.sum()) for part in parts)
        return [part.material.colour for part in parts], texture

    assert figures(1) == figures(1)
    assert any(figures(1) != figures(seed) for seed in (2, 3, 4))


def test_another_seed_weaves_another_rug():
    rng = np.random.default_rng(0)
    pictures = [household.rug(rng, seed=seed)[-1].material.texture.pixels() for seed in (0, 1)]
    assert (pictures[0] != pictures[1]).mean() > 0.3
