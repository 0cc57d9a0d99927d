"""Objects outdoors: sizes of the real things, feet on the ground, and people who walk without slipping."""

import numpy as np
import pytest

from tests.asset.solids import area_vectors, bounds_m, extent_m, front_agreement, is_closed, volume_m3
from vobench.asset import outdoors
from vobench.asset.outdoors import LEG_M, NOMINAL_HEIGHT_M, STEPS, foliage, walker

KINDS = ("car", "person", "tree", "street_lamp", "bollard", "bush", "rock", "park_bench", "park_lamp")
ON_THE_GROUND = ("car", "person", "tree", "street_lamp", "bollard", "park_bench", "park_lamp")
MIRRORED = ("car", "street_lamp", "bollard", "park_bench", "park_lamp")


def made(kind, seed=0, **size):
    return getattr(outdoors, kind)(np.random.default_rng(seed), **size)


@pytest.fixture(scope="module")
def pieces():
    return {kind: made(kind) for kind in KINDS}


@pytest.mark.parametrize("kind", ON_THE_GROUND)
def test_an_object_stands_on_the_ground(pieces, kind):
    assert bounds_m(pieces[kind])[0][2] == pytest.approx(0, abs=0.015)


@pytest.mark.parametrize("kind", MIRRORED)
def test_an_object_is_as_wide_to_its_left_as_to_its_right(pieces, kind):
    lowest_m, highest_m = bounds_m(pieces[kind])
    assert highest_m[1] == pytest.approx(-lowest_m[1], abs=1e-6)


@pytest.mark.parametrize("kind", KINDS)
def test_closed_parts_are_not_inside_out_and_the_front_of_each_face_is_that_of_its_normals(pieces, kind):
    for part in pieces[kind]:
        assert front_agreement(part).min() > 0
        has_leaves = part.material.cutout is not None
        if has_leaves:
            assert volume_m3(part) == pytest.approx(0, abs=1e-9)  # leaves have two sides and no thickness
        elif is_closed(part):
            assert volume_m3(part) > 0


def test_a_car_has_the_size_of_a_hatchback_and_its_roof_is_behind_its_bonnet(pieces):
    np.testing.assert_allclose(extent_m(pieces["car"]), [4.25, 2.16, 1.46], atol=0.05)
    body, glass = pieces["car"][:2]
    roof_x_m = glass.arrays.vertices_m[glass.arrays.vertices_m[:, 2] > 1.4][:, 0]
    assert roof_x_m.mean() < 0.2
    assert bounds_m([body])[1][2] < bounds_m([glass])[1][2]


def test_the_body_of_a_car_is_closed_but_for_its_seams_and_faces_outwards(pieces):
    body = pieces["car"][0]
    outwards = body.arrays.corners_m.mean(axis=1) - [0, 0, 0.6]
    agreement = (area_vectors(body) * outwards).sum(axis=1)
    assert (agreement > 0).mean() > 0.9
    assert 3 < volume_m3(body) < 4.2 * 1.8 * 0.75


def test_a_car_has_four_wheels_with_the_ground_under_them_and_their_rims_outside(pieces):
    tyres = [part for part in pieces["car"] if extent_m([part])[0] == pytest.approx(0.62, abs=0.01)]
    assert len(tyres) == 4
    for tyre in tyres:
        assert bounds_m([tyre])[0][2] == pytest.approx(0, abs=0.01)
    places = {tuple(np.sign(tyre.arrays.vertices_m.mean(axis=0)[:2]).tolist()) for tyre in tyres}
    assert places == {(-1, -1), (-1, 1), (1, -1), (1, 1)}
    rims = [part for part in pieces["car"] if part.material is outdoors.STEEL]
    outer_y_m = [np.abs(rim.arrays.vertices_m[:, 1]).max() for rim in rims]
    assert min(outer_y_m) > 0.815  # the axles end at 0.815 m


def test_both_number_plates_of_a_car_show_the_same_number_away_from_it(pieces):
    plates = [part for part in pieces["car"] if len(part.arrays.faces) == 2]
    assert len(plates) == 2
    directions = [np.sign(area_vectors(plate)[0, 0]) for plate in plates]
    ends = [np.sign(plate.arrays.vertices_m[:, 0].mean()) for plate in plates]
    assert directions == ends == [1, -1]
    assert plates[0].material == plates[1].material


@pytest.mark.parametrize("height_m", [1.5, 1.9])
def test_a_person_is_as_tall_as_asked_for_whatever_the_step(height_m):
    for seed in range(3):
        assert extent_m(made("person", seed, height_m=height_m))[2] == pytest.approx(height_m, rel=0.03)


def test_all_lengths_of_a_walker_are_in_proportion_to_the_height():
    small = walker(np.random.default_rng(5), NOMINAL_HEIGHT_M)
    large = walker(np.random.default_rng(5), 2 * NOMINAL_HEIGHT_M)
    assert large.cycle_m == pytest.approx(2 * small.cycle_m)
    np.testing.assert_allclose(large.rise_m, 2 * small.rise_m)
    for limb, twice in zip(small.limbs, large.limbs, strict=True):
        np.testing.assert_allclose(twice.joints_m, 2 * limb.joints_m)
        np.testing.assert_array_equal(twice.pitch_rad, limb.pitch_rad)


def test_the_lowest_point_of_a_walker_is_on_the_ground_at_every_step():
    who = walker(np.random.default_rng(0))
    for step in range(STEPS):
        posed = [part for limb in who.limbs for part in limb.posed(step)]
        assert bounds_m(posed)[0][2] + who.rise_m[step] == pytest.approx(0, abs=1e-9)


def test_a_foot_on_the_ground_moves_backwards_as_fast_as_the_walker_moves_forwards():
    """So it does not slip. In half a cycle the body advances by half of `cycle_m`."""
    who = walker(np.random.default_rng(0), stride_deg=25.0)
    (left_thigh,) = [limb for limb in who.limbs if _is_left_thigh(limb)]
    forwards_m = LEG_M * np.sin(-left_thigh.pitch_rad[:, 0])  # of the sole, from the hip
    steps_m = np.diff(forwards_m[: STEPS // 2 + 1])
    np.testing.assert_allclose(steps_m, -who.cycle_m / STEPS, rtol=1e-9)


def _is_left_thigh(limb):
    is_hip = limb.joints_m.shape == (1, 3) and limb.joints_m[0, 2] < 1
    return is_hip and limb.joints_m[0, 1] > 0


def test_the_right_side_does_what_the_left_side_did_half_a_cycle_before():
    who = walker(np.random.default_rng(0))
    trunk, *limbs = who.limbs
    right, left = limbs[:3], limbs[3:]
    assert trunk.joints_m.shape == (0, 3)
    for one, other in zip(right, left, strict=True):
        np.testing.assert_allclose(one.joints_m, other.joints_m * [1, -1, 1])
        np.testing.assert_allclose(one.pitch_rad, np.roll(other.pitch_rad, STEPS // 2, axis=0))


def test_arms_swing_against_the_legs_of_their_side_and_knees_bend_backwards_only():
    who = walker(np.random.default_rng(0))
    _, thigh, shin, arm = who.limbs[:4]
    assert (thigh.pitch_rad * arm.pitch_rad).sum() < 0
    assert shin.pitch_rad[:, 1].min() > 0
    np.testing.assert_array_equal(shin.pitch_rad[:, 0], thigh.pitch_rad[:, 0])


def test_a_longer_stride_covers_more_ground():
    cycles_m = [walker(np.random.default_rng(0), stride_deg=degrees).cycle_m for degrees in (10, 20, 30)]
    assert cycles_m == sorted(cycles_m)
    assert cycles_m[2] == pytest.approx(4 * LEG_M * 0.5)  # sin 30°


@pytest.mark.parametrize(
    ("kind", "size", "tolerance"),
    [
        ("tree", {"height_m": 4.0}, 0.02),
        ("rock", {"size_m": 0.5}, 0.1),  # its breaks and waves are not in proportion
        ("bush", {"height_m": 1.0, "width_m": 1.5}, 0.02),
        ("bollard", {"height_m": 0.8}, 1e-9),
    ],
)
def test_twice_the_size_is_twice_the_height(kind, size, tolerance):
    height_m = extent_m(made(kind, **size))[2]
    twice = {name: 2 * value for name, value in size.items()}
    assert extent_m(made(kind, **twice))[2] == pytest.approx(2 * height_m, rel=tolerance)


@pytest.mark.parametrize("kind", ["street_lamp", "park_lamp"])
def test_a_lamp_is_longer_by_its_height_alone(kind):
    extents_m = [extent_m(made(kind, height_m=height_m)) for height_m in (3.0, 4.5)]
    np.testing.assert_allclose(extents_m[1] - extents_m[0], [0, 0, 1.5], atol=1e-9)


def test_the_arm_of_a_street_lamp_ends_where_its_light_belongs():
    mast, _, head = made("street_lamp", height_m=4.0, reach_m=1.5)
    assert head.arrays.vertices_m[:, 0].mean() == pytest.approx(1.5, abs=0.01)
    assert bounds_m([head])[0][2] == pytest.approx(4.0, abs=0.02)
    assert bounds_m([mast])[1][2] < 4.0


def test_the_lantern_of_a_park_lamp_leaves_room_for_its_globe():
    _, hat = made("park_lamp", height_m=3.0)
    assert bounds_m([hat])[0][2] > 3.0 + 0.14


def test_a_tree_has_its_leaves_above_its_trunk_and_as_many_clumps_as_asked_for():
    trunk, _, leaves = made("tree", height_m=5.0, clumps=40)
    assert len(leaves.arrays.faces) == 40 * 4  # two faces on each side of a card
    assert leaves.arrays.vertices_m[:, 2].mean() > 0.5 * 5.0
    assert bounds_m([trunk])[1][2] < bounds_m([leaves])[1][2]


def test_about_a_third_of_a_rock_is_in_the_ground():
    shares = []
    for seed in range(6):
        lowest_m, highest_m = bounds_m(made("rock", seed))
        shares.append(-lowest_m[2] / (highest_m[2] - lowest_m[2]))
    assert 0.2 < np.mean(shares) < 0.4


def test_a_person_on_a_bench_looks_along_x_since_the_back_is_behind_the_seat():
    _, slats = made("park_bench", width_m=2.0)
    assert extent_m([slats])[1] == pytest.approx(2.0, abs=1e-6)
    vertices_m = slats.arrays.vertices_m
    is_back = vertices_m[:, 2] > 0.5
    assert vertices_m[is_back, 0].max() < vertices_m[~is_back, 0].mean()


def test_foliage_is_leaves_in_front_of_nothing_and_none_is_cut_off_at_the_border():
    pixels = foliage(0, 256).pixels()
    opacity = pixels[..., 3]
    assert set(np.unique(opacity)) == {0, 255}
    assert 0.3 < (opacity == 255).mean() < 0.9
    border = np.concatenate([opacity[0], opacity[-1], opacity[:, 0], opacity[:, -1]])
    assert border.max() == 0
    red, green, blue = pixels[opacity == 255][:, :3].mean(axis=0)
    assert green > red > blue


def test_a_seed_makes_the_same_object_again_and_another_seed_another_one():
    def figures(kind, seed):
        parts = made(kind, seed)
        return [part.material.colour for part in parts], [float(part.arrays.vertices_m.sum()) for part in parts]

    for kind in ("car", "person", "tree", "bush", "rock"):
        assert figures(kind, 1) == figures(kind, 1)
        assert any(figures(kind, 1) != figures(kind, seed) for seed in (2, 3))
