"""A path is placed where it is free and where the disparities along it agree."""

import json

import numpy as np
import pytest

from vobench.analysis import path_placement
from vobench.analysis.pair_calibration import CalibratedPair, PairCalibration
from vobench.analysis.pair_parameter import BASELINE, PARAMETERS, YAW
from vobench.analysis.path_placement import (
    ANY_SCALE,
    CELLS,
    RAYS_PER_CELL,
    TENTHS,
    Placement,
    PlacementLimits,
    WantedDisparities,
    _Start,
    _Surroundings,
    _view_rays,
    _weighted_tenths,
    cell_disparities,
    levelled,
    nearness_of,
    place_path,
    segment_disparities,
    wanted_disparities,
)
from vobench.analysis.stereo_fit import StereoFit, Uncertain
from vobench.analysis.stereo_matches import Matches
from vobench.errors import InputError
from vobench.estimator.stereo import stereo_pair
from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import looking, stereo_rig
from vobench.rendering.geometry import RayCaster
from vobench.scene.material import Material
from vobench.scene.mesh import flat_shaded, flipped
from vobench.scene.scene import Scene, triangles
from vobench.scene.triangles import Thing

LENS = Pinhole(160, 120, 150.0, 150.0, 79.5, 59.5)
PAIR = stereo_pair(stereo_rig(LENS, pitch_deg=0, baseline_m=0.2), "test")


@pytest.fixture(autouse=True)
def few_draws(monkeypatch):
    monkeypatch.setattr(path_placement, "LANES", 20)


def hall(*, pillar: bool = False) -> Scene:
    """A room of 8 x 6 x 3 m seen from within, and perhaps a pillar that leaves no way through its middle."""
    boxes = [((-4, -3, 0), (4, 3, 3), True), *([((-2.9, -1.9, 0), (2.9, 1.9, 2.9), False)] if pillar else [])]
    things = []
    for number, (low, high, inward) in enumerate(boxes):
        corners = np.array(
            [[(low, high)[i >> 2 & 1][0], (low, high)[i >> 1 & 1][1], (low, high)[i & 1][2]] for i in range(8)], float
        )
        faces = np.array(
            [
                [0, 1, 3],
                [0, 3, 2],
                [4, 6, 7],
                [4, 7, 5],
                [0, 4, 5],
                [0, 5, 1],
                [2, 3, 7],
                [2, 7, 6],
                [0, 2, 6],
                [0, 6, 4],
                [1, 5, 7],
                [1, 7, 3],
            ]
        )
        corners_m = corners[faces]
        vertices = corners_m.reshape(-1, 3)
        mesh = flat_shaded(vertices, np.arange(len(vertices)).reshape(-1, 3), np.zeros((len(vertices), 2)))
        outward = np.einsum("ij,ij->i", mesh.vertex_normals[::3], corners_m.mean(1) - corners.mean(0)) > 0
        turned = flipped(mesh) if outward.all() == inward else mesh
        things.append(Thing(f"box_{number}", turned, "paint"))
    return Scene("hall", tuple(things), {"paint": Material()}, ())


def straight(length_m: float, count: int = 20) -> np.ndarray:
    way = np.zeros((count, 3))
    way[:, 0] = np.linspace(0, length_m, count)
    return se3.transform(np.eye(3), way) @ looking(pitch_deg=0, position_m=(0, 0, 0))


def of_wall(distance_m: float) -> WantedDisparities:
    """The disparities of a wall that fills the view."""
    return WantedDisparities.of_cells(np.full((1, 3, 3), 150 * 0.2 / distance_m))


def test_a_path_lies_free_and_its_disparities_agree():
    (found,) = place_path(hall(), straight(1.5), PAIR, of_wall(2.5))
    places = (found.T_place_world @ straight(1.5))[:, :3, 3] / found.scale
    assert (np.abs(places) < [3.9, 2.9, 3.0]).all()
    assert found.misfit < 0.5
    assert 0.8 <= found.scale <= 1.2


def test_a_place_is_enlarged_only_where_that_is_allowed_and_its_own_size_does_not_fit():
    far = of_wall(50.0)  # a hall of 8 m has nothing so far away
    assert 0.8 <= place_path(hall(), straight(1.5), PAIR, far)[0].scale <= 1.2
    long = straight(12.0)
    with pytest.raises(InputError, match=r"no free path of 12.0 m .*it fits nowhere at scales of 0.8 to 1.2"):
        place_path(hall(), long, PAIR, far)
    (enlarged,) = place_path(hall(), long, PAIR, far, limits=ANY_SCALE)
    assert enlarged.scale == 1.4  # along the diagonal
    in_place_m = (enlarged.T_place_world @ long)[:, :3, 3]
    low_m, high_m = np.array([-4, -3, 0]) * enlarged.scale, np.array([4, 3, 3]) * enlarged.scale
    assert ((in_place_m > low_m + 0.29) & (in_place_m < high_m - 0.29)).all()


def seen(path: np.ndarray, *, nearer: float = 1.0) -> WantedDisparities:
    """The disparities of a path in the hall, multiplied by a factor."""
    caster = RayCaster(triangles(hall(), t_ns=0))
    cells_px = nearer * segment_disparities(caster, path, PAIR, 1.0, 4)
    tenths_px = np.quantile(cells_px.reshape(4, -1), TENTHS, axis=1).T
    return WantedDisparities(cells_px, np.ones((4, 3, 3)), tenths_px)


def test_where_a_path_was_is_found_by_its_disparities_along_the_way():
    scene = hall()
    there = se3.transform(se3.rotation_z(0.4), (-2.5, 0.6, 1.2)) @ straight(4.0)
    at_its_scale = PlacementLimits(((1.0,),), 1.5)
    (found,) = place_path(scene, straight(4.0), PAIR, seen(there), limits=at_its_scale)
    ends = (found.T_place_world @ straight(4.0))[[0, -1], :2, 3] / found.scale
    assert found.misfit < 0.05
    assert found.nearness < 1.5
    # The hall is its own image when it is turned by half.
    assert min(np.abs(sign * ends - there[[0, -1], :2, 3]).max() for sign in (1, -1)) < 0.25


def test_a_place_whose_surfaces_are_nearer_than_in_the_recording_is_refused():
    there = se3.transform(np.eye(3), (-2.5, 0.0, 1.2)) @ straight(4.0)
    with pytest.raises(InputError, match=r"free lanes, surfaces are \d+\.\d times as near as in the recording or more"):
        place_path(hall(), straight(4.0), PAIR, seen(there, nearer=0.1))
    assert place_path(hall(), straight(4.0), PAIR, seen(there, nearer=0.1), limits=ANY_SCALE)


def test_several_placements_are_different_and_the_best_one_is_first():
    found = place_path(hall(), straight(1.5), PAIR, of_wall(2.5), most=3)
    assert len(found) == 3
    costs = [each.misfit + 0.05 * abs(np.log(each.scale)) for each in found]
    assert costs == sorted(costs)
    for index, one in enumerate(found):
        for other in found[:index]:
            (there, here) = (each.T_place_world @ straight(1.5) for each in (one, other))
            middle_m = np.linalg.norm(there[10, :2, 3] / one.scale - here[10, :2, 3] / other.scale)
            turn = se3.rotation_angle(np.linalg.inv(there[0, :3, :3]) @ here[0, :3, :3])
            assert middle_m > 0.2 or turn > np.deg2rad(15)  # draws near a candidate move it a little


def test_the_nearness_is_that_of_the_nearest_picture():
    caster = RayCaster(triangles(hall(), t_ns=0))
    path = straight(4.0)
    path[:, :3, 3] += [-1.0, 0.0, 1.5]
    whole = seen(path)
    assert nearness_of(caster, path, PAIR, 1.0, whole) == pytest.approx(1.0, abs=0.6)
    to_the_wall = straight(5.5)
    to_the_wall[:, :3, 3] += [-2.0, 0.0, 1.5]
    # At 0.5 m from the wall it fills the picture: 60 px, where the recording has a tenth below some 6 px.
    lowest_px = whole.tenths_px[-1, 0]
    assert nearness_of(caster, to_the_wall, PAIR, 1.0, whole) == pytest.approx(60 / lowest_px, rel=0.02)
    unknown = WantedDisparities.of_cells(whole.cells_px)
    assert nearness_of(caster, to_the_wall, PAIR, 1.0, unknown) == 0


def test_rays_count_where_the_recording_has_matches() -> None:
    disparity_px = np.full((3, 3, 4), 10.0)
    disparity_px[0, 0] = 100.0
    disparity_px[2, 2] = np.nan
    counts = np.zeros((3, 3))
    counts[0, 0] = 1
    counts[1, 1] = 3
    counts[2, 2] = 50
    assert _weighted_tenths(disparity_px, counts).tolist() == [10, 100]
    counts[0, 0] = 0.1
    assert _weighted_tenths(disparity_px, counts).tolist() == [10, 10]
    assert _weighted_tenths(np.full((3, 3, 4), np.nan), counts).tolist() == [0, 0]


def test_a_place_without_a_free_space_is_refused():
    with pytest.raises(InputError, match=r"no free path of 60.0 m was found in 'hall' .*; take fewer images"):
        place_path(hall(pillar=True), straight(60.0), PAIR, of_wall(3.0))


def test_a_placement_is_read_as_it_was_written() -> None:
    (found,) = place_path(hall(), straight(1.5), PAIR, of_wall(2.5))
    read = Placement.of_dict(json.loads(json.dumps(found.as_dict())))
    np.testing.assert_array_equal(read.T_place_world, found.T_place_world)
    assert (read.scale, read.misfit, read.nearness, read.tried) == (
        found.scale,
        found.misfit,
        found.nearness,
        found.tried,
    )


def test_a_tilted_world_is_levelled():
    turn = np.linspace(0, 5, 60)
    circle = np.stack([np.cos(turn), np.sin(turn), np.zeros(60)], -1) * 3
    level = se3.transform(np.eye(3), circle)
    tilt = se3.transform(se3.rotation_z(0.3) @ looking(pitch_deg=-8, position_m=(0, 0, 0))[:3, [2, 0, 1]], np.zeros(3))
    assert np.ptp((tilt @ level)[:, 2, 3]) > 0.5
    assert np.ptp(levelled(tilt @ level)[:, 2, 3]) < 0.02


# --- Disparities by cells ---


def calibrated_with(offset_px: float, *, is_offset_determined: bool) -> CalibratedPair:
    """A calibration with a yaw that shifts disparities at the centre by an offset."""
    parameters = tuple(parameter for parameter in PARAMETERS if parameter.name in (BASELINE, YAW))
    yaw_deg = np.rad2deg(offset_px / 150)
    errors = np.array([0.0, yaw_deg / parameters[1].sigma])
    calibration = PairCalibration(parameters, errors, np.eye(2), PAIR)
    return CalibratedPair(calibration, calibration, False, is_offset_determined)


def fit_of(places, disparity_px, window, *, calibrated=None) -> StereoFit:
    matches = Matches(
        np.array(places, float), np.zeros(len(places)), np.array(disparity_px, float), np.array(window, np.int64)
    )
    nothing = Uncertain(0.0, 1.0)
    return StereoFit(
        focal_px=150.0,
        baseline_m=0.2,
        matches=matches,
        row_mad_px=0.0,
        row_noise_px=0.0,
        coefficients=np.zeros(5),
        roll_deg=nothing,
        pitch_deg=nothing,
        xy_px=nothing,
        gain=1.0,
        disparity_px=(0.0, 0.0, 0.0),
        yaw_deg=None,
        yaw_from="",
        calibrated=calibrated,
    )


def cells(left_px, disparity_px, *, count=30, window=0, calibrated=None) -> np.ndarray:
    """Disparities by cell where `count` matches have one left pixel and disparity."""
    right_px = np.array(left_px) - [disparity_px, 0]
    place = (right_px - [79.5, 59.5]) / 150
    fit = fit_of([place] * count, [disparity_px] * count, [window] * count, calibrated=calibrated)
    return cell_disparities(fit, PAIR)


@pytest.mark.parametrize("row", range(3))
@pytest.mark.parametrize("column", range(3))
def test_a_match_counts_in_the_cell_of_its_left_pixel(row: int, column: int) -> None:
    found = cells(((column + 0.5) * 160 / 3, (row + 0.5) * 40), 12.0)
    assert found.shape == (1, 3, 3)
    assert found[0, row, column] == pytest.approx(12)
    assert np.isfinite(found).sum() == 1


def test_cells_of_fewer_than_30_matches_are_unknown_and_stretches_are_counted_from_the_first() -> None:
    assert np.isnan(cells((20, 20), 12.0, count=29)).all()
    later = cells((20, 20), 12.0, window=2)
    assert later.shape == (3, 3, 3)
    assert np.isnan(later[:2]).all()
    assert later[2, 0, 0] == pytest.approx(12)


def test_what_the_right_camera_adds_to_disparities_is_taken_off_at_the_place_of_each_match() -> None:
    known = calibrated_with(0.5, is_offset_determined=True)
    center = (79.5, 59.5)
    at_center_px = cells(center, 12.0, calibrated=known)[0, 1, 1]
    assert at_center_px == pytest.approx(11.5, abs=0.01)
    # A yaw shifts pixels by 1 + x² of what it shifts at the centre; x is that of the right pixel, 12 px further left.
    slope = (150 - 12 - 79.5) / 150
    assert cells((150, 59.5), 12.0, calibrated=known)[0, 1, 2] == pytest.approx(12 - 0.5 * (1 + slope**2), abs=0.01)
    unknown = calibrated_with(0.5, is_offset_determined=False)
    assert cells(center, 12.0, calibrated=unknown)[0, 1, 1] == 12


def test_far_points_are_at_a_third_of_a_pixel() -> None:
    assert cells((20, 20), 0.1)[0, 0, 0] == 0.3


def test_the_tenths_are_quantiles_of_all_matches_of_a_segment_and_cells_have_counts() -> None:
    px = np.linspace(5, 15, 101)
    places = [((20 - d) / 150 - 79.5 / 150, (20 - 59.5) / 150) for d in px]
    wanted = wanted_disparities(fit_of([*places, *places[:9]], [*px, *px[:9]], [1] * 101 + [2] * 9), PAIR)
    np.testing.assert_allclose(wanted.tenths_px[1], [6, 14])
    assert np.isnan(wanted.tenths_px[[0, 2]]).all()
    assert wanted.counts[:, 0, 0].tolist() == [0, 101, 9]
    assert wanted.counts.sum() == 110


def test_a_cell_has_the_median_of_its_matches() -> None:
    px = [10.0] * 20 + [20.0] * 40
    places = [((20 - d) / 150 - 79.5 / 150, (20 - 59.5) / 150) for d in px]
    assert cell_disparities(fit_of(places, px, [0] * 60), PAIR)[0, 0, 0] == 20


# --- Levelling ---


def test_a_level_path_stays_and_levelling_is_a_rotation_of_the_world() -> None:
    turn = np.linspace(0, 5, 60)
    level = se3.transform(se3.rotation_z(turn), np.stack([3 * np.cos(turn), 2 * np.sin(turn), 0 * turn], -1))
    np.testing.assert_allclose(levelled(level), level, atol=1e-9)
    tilt = looking(pitch_deg=-8, position_m=(0, 0, 0))
    found = levelled(tilt @ level)
    T = found @ se3.inverse(tilt @ level)
    np.testing.assert_allclose(T, np.broadcast_to(T[0], T.shape), atol=1e-9)
    np.testing.assert_allclose(T[0, :3, 3], 0, atol=1e-9)


def test_a_straight_climb_is_levelled_along_its_way_alone() -> None:
    along = np.linspace(0, 5, 40)
    climb = se3.transform(np.eye(3), np.stack([along, 0 * along, 0.2 * along], -1))
    found = levelled(climb)
    assert np.ptp(found[:, 2, 3]) == pytest.approx(1e-3 * np.ptp(climb[:, 2, 3]), rel=0.1)  # but for the damping
    np.testing.assert_allclose(found[:, 1, 3], 0, atol=1e-9)  # not turned aside
    assert found[-1, 0, 3] == pytest.approx(5 * np.hypot(1, 0.2), rel=1e-3)


def test_a_slope_across_that_a_nearly_straight_path_hardly_shows_is_levelled_in_part() -> None:
    """The damping halves the slope where the spread across is a thousandth of the spread along and across."""
    along = np.tile(np.linspace(-5, 5, 40), 2)
    across = np.repeat([-1.0, 1.0], 40) * np.sqrt(1e-3 * np.mean(along**2))
    path = se3.transform(np.eye(3), np.stack([along, across, 0.5 * across], -1))
    left, right = levelled(path)[[0, 40]]
    slope = (right[2, 3] - left[2, 3]) / (right[1, 3] - left[1, 3])
    assert slope == pytest.approx(np.tan(np.arctan(0.5) - np.arctan(0.25)), rel=0.01)


# --- Disparities in a scene ---


def test_the_rays_of_a_view_are_centred_in_its_cells_and_point_ahead() -> None:
    rays = _view_rays(PAIR)
    rows_and_columns = CELLS * RAYS_PER_CELL
    assert rays.shape == (rows_and_columns**2, 3)
    pixels = PAIR.left.camera.project(rays)
    width_px, height_px = LENS.width_px, LENS.height_px
    np.testing.assert_allclose(pixels.mean(axis=0), [width_px / 2, height_px / 2])
    borders_px = np.array([width_px, height_px]) / rows_and_columns / 2
    np.testing.assert_allclose(pixels[0], borders_px)
    np.testing.assert_allclose(pixels[-1], [width_px, height_px] - borders_px)


def test_disparities_of_a_wall_follow_from_its_distance_in_every_cell_and_with_the_scale() -> None:
    caster = RayCaster(triangles(hall(), t_ns=0))
    pose = se3.transform(np.eye(3), (2.0, 0.0, 1.5)) @ looking(pitch_deg=0, position_m=(0, 0, 0))
    for scale in (1.0, 2.0):
        found = segment_disparities(caster, pose[None], PAIR, scale, 1)
        assert found.shape == (1, 3, 3)
        assert found == pytest.approx(150 * 0.2 / (2.0 * scale), rel=1e-5)  # the wall at x = 4 fills the view


def test_each_stretch_is_seen_from_its_middle_and_cells_are_rows_then_columns() -> None:
    caster = RayCaster(triangles(hall(), t_ns=0))
    path = straight(3.0, count=40)
    path[:, :3, 3] += [-3.0, 0.0, 1.0]
    path[:, 1, 3] = 1.5  # nearer to the left wall
    found = segment_disparities(caster, path, PAIR, 1.0, 2)
    middles = [path[10], path[30]]
    for stretch, pose in enumerate(middles):
        np.testing.assert_allclose(found[stretch], segment_disparities(caster, pose[None], PAIR, 1.0, 1)[0])
    assert found[0, 1, 0] > found[0, 1, 2]  # left is nearer than right
    assert found[0, 2, 1] > found[0, 0, 1]  # the floor is nearer than the ceiling, from 1 m above it


def test_where_nothing_is_seen_disparities_are_those_of_far_points() -> None:
    caster = RayCaster(triangles(hall(), t_ns=0))
    outside = se3.transform(np.eye(3), (10.0, 0.0, 1.5)) @ looking(pitch_deg=0, position_m=(0, 0, 0))
    assert (segment_disparities(caster, outside[None], PAIR, 1.0, 1) == 0.3).all()


# --- The place ---


@pytest.fixture(scope="module")
def place() -> _Surroundings:
    return _Surroundings.of(hall())


def start(**changes) -> _Start:
    return _Start(**{"scale": 1.0, "height_m": 1.2, "heading_rad": 0.0, "xy_m": np.array([-1.0, 0.5]), **changes})


@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_a_path_starts_at_its_start_in_its_direction_and_at_its_height(place: _Surroundings, scale: float) -> None:
    path = se3.transform(se3.rotation_z(0.2), (7.0, 8.0, 9.0)) @ straight(1.0)
    T = place.free_pose(path, start(scale=scale, heading_rad=0.3))
    first, second = (T @ se3.transform(path[:, :3, :3], path[:, :3, 3] / scale))[[0, -1]]
    np.testing.assert_allclose(first[:3, 3], [-1.0, 0.5, 1.2 / scale], atol=1e-6)
    direction = second[:3, 3] - first[:3, 3]
    np.testing.assert_allclose(direction, np.array([np.cos(0.5), np.sin(0.5), 0]) / scale, atol=1e-6)


def test_a_path_that_descends_starts_so_high_that_its_lowest_point_is_at_the_height(place: _Surroundings) -> None:
    path = straight(1.0)
    path[:, 2, 3] = np.linspace(0, -0.6, len(path))
    T = place.free_pose(path, start(height_m=0.8))
    heights_m = (T @ path)[:, 2, 3]
    assert heights_m[0] == pytest.approx(1.4)
    assert heights_m.min() == pytest.approx(0.8)


@pytest.mark.parametrize(
    ("changes", "is_free"),
    [
        ({}, True),
        ({"xy_m": np.array([3.2, 0.5])}, False),  # through the wall at x = 4
        ({"xy_m": np.array([2.65, 0.5])}, True),  # 0.35 m before it
        ({"xy_m": np.array([2.75, 0.5])}, False),  # 0.25 m before it
        ({"xy_m": np.array([-1.0, 2.8])}, False),  # too near to the wall beside it
        ({"height_m": 2.6}, True),
        ({"height_m": 2.8}, False),  # too near to the ceiling
        ({"height_m": 3.1}, False),  # above it
        ({"height_m": 0.2}, False),  # too near to the floor
        ({"xy_m": np.array([5.0, 0.5])}, False),  # without a floor
    ],
)
def test_a_path_is_free_at_0_3_m_from_everything(place: _Surroundings, changes, is_free) -> None:
    assert (place.free_pose(straight(1.0), start(**changes)) is not None) == is_free


def test_inside_of_an_object_nothing_is_free() -> None:
    blocked = _Surroundings.of(hall(pillar=True))
    assert blocked._ground_m(np.array([-3.4, 0.0])) == pytest.approx(0, abs=1e-6)
    assert blocked._ground_m(np.array([0.0, 0.0])) is not None
    assert blocked.free_pose(straight(0.5), start(xy_m=np.array([0.0, 0.0]))) is None
    assert not blocked._is_free(np.array([[0.0, 0.0, 1.0], [0.1, 0.0, 1.0]]), 0.05)
    assert blocked._is_free(np.array([[-3.4, 0.0, 1.0], [-3.4, 0.5, 1.0]]), 0.3)


def test_starts_near_another_are_spread_by_the_share_of_a_metre_and_0_3_rad() -> None:
    rng = np.random.default_rng(0)
    for share in (1.0, 0.1):
        near = [start().near(share, rng) for _ in range(2000)]
        assert np.std([each.xy_m - start().xy_m for each in near], axis=0) == pytest.approx([share] * 2, rel=0.06)
        assert np.mean([each.xy_m for each in near], axis=0) == pytest.approx([-1.0, 0.5], abs=0.1 * share)
        assert np.std([each.heading_rad for each in near]) == pytest.approx(0.3 * share, rel=0.06)
        assert np.std(np.log([each.height_m / 1.2 for each in near])) == pytest.approx(0.3 * share, rel=0.06)
        assert {each.scale for each in near} == {1.0}


def test_a_path_may_come_as_close_as_the_clearance_and_no_closer(place: _Surroundings) -> None:
    up_to_half_a_metre = np.array([[3.25, 0.0, 1.5], [3.5, 0.0, 1.5]])
    # Embree's distances are float32, and processors round them differently.
    assert place._is_free(up_to_half_a_metre, 0.5 - 1e-6)
    assert not place._is_free(up_to_half_a_metre, 0.5 + 1e-6)


def test_every_face_counts_the_first_one_too(place: _Surroundings) -> None:
    near_first = np.array([[-3.8, -2.0, 2.4], [-3.7, -2.0, 2.4]])  # the first triangle is that part of the wall
    hits = place.caster.hits(near_first[:1], np.array([[-1.0, 0.0, 0.0]]))
    assert hits.face.tolist() == [0]
    assert not place._is_free(near_first, 0.3)
    assert place._is_free(near_first, 0.1)
    through_first = np.array([[-3.5, -2.0, 2.4], [-4.5, -2.0, 2.4]])
    assert not place._is_free(through_first, 0.01)
