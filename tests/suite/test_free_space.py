"""The free circle lies on the floor and holds no thing, and the path in it is a circle at constant speed."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.asset.shape import at, block, sheet
from vobench.errors import SuiteError
from vobench.rendering.geometry import RayCaster
from vobench.scene.material import Material
from vobench.scene.mesh import moved, quad
from vobench.scene.scene import Scene, triangles
from vobench.scene.triangles import Thing
from vobench.suite.free_space import (
    CELL_M,
    MOST_LENGTH_M,
    MOST_RADIUS_M,
    RATE_HZ,
    SPEED_MPS,
    FreeCircle,
    circular_path,
    downward_directions,
    floor_map,
    largest_free_circle,
)
from vobench.suite.level_floor import FLOOR_STEP_M

GREY = {"grey": Material(colour=(0.5, 0.5, 0.5))}


def floor(length_m: float, width_m: float, *, x_m: float = 0.0, y_m: float = 0.0, z_m: float = 0.0) -> Thing:
    """A level rectangle around a place, seen from above."""
    corner_m = (x_m - length_m / 2, y_m - width_m / 2, z_m)
    return Thing("floor", quad(corner_m, (length_m, 0, 0), (0, width_m, 0)), "grey")


def ceiling(length_m: float, width_m: float, *, z_m: float = 2.5) -> Thing:
    """A level rectangle around the origin, seen from below."""
    return Thing("ceiling", quad((-length_m / 2, width_m / 2, z_m), (length_m, 0, 0), (0, -width_m, 0)), "grey")


def box(x_m: float, y_m: float, size_m: tuple[float, float, float], *, z_m: float = 0.0) -> Thing:
    """A box that stands at a place."""
    return Thing("box", moved(block(size_m, bevel_m=0), at(x_m, y_m, z_m + size_m[2] / 2)), "grey")


def scene(*things: Thing) -> Scene:
    return Scene("yard", things, GREY, ())


def circle(*things: Thing) -> FreeCircle | None:
    faces = triangles(scene(*things), t_ns=0)
    return largest_free_circle(faces, RayCaster(faces))


def test_the_circle_of_an_empty_floor_ends_exactly_at_its_edge() -> None:
    free = circle(floor(8, 6))
    assert free is not None
    assert free.floor_m == 0
    # The centre is that of the first of the two middle rows of cells, and the nearer edge is 3 m - 0.05 m away.
    assert free.y_m == pytest.approx(-CELL_M / 2)
    assert free.radius_m == pytest.approx(3 - CELL_M / 2)
    assert free.y_m - free.radius_m == pytest.approx(-3)
    assert free.x_m - free.radius_m >= -4
    assert free.x_m + free.radius_m <= 4


@pytest.mark.parametrize("side_m", [0.9, 1.7, 3.1])
def test_a_circle_never_reaches_beyond_its_floor(side_m: float) -> None:
    free = circle(floor(side_m, side_m))
    assert free is not None
    for centre_m in (free.x_m, free.y_m):
        assert abs(centre_m) + free.radius_m <= side_m / 2 + 1e-9
        assert abs(centre_m) + free.radius_m > side_m / 2 - 1.01 * CELL_M


def test_the_circle_moves_with_its_floor_and_turns_with_it() -> None:
    free = circle(floor(5, 3))
    shifted = circle(floor(5, 3, x_m=7.0, y_m=-2.0, z_m=0.5))
    turned = circle(floor(3, 5))
    assert free is not None
    assert shifted is not None
    assert turned is not None
    assert shifted.radius_m == pytest.approx(free.radius_m)
    assert turned.radius_m == pytest.approx(free.radius_m)
    assert (shifted.x_m, shifted.y_m) == (pytest.approx(free.x_m + 7), pytest.approx(free.y_m - 2))
    assert shifted.floor_m == pytest.approx(0.5, abs=FLOOR_STEP_M / 2)
    assert turned.x_m == pytest.approx(free.y_m)


def test_no_thing_is_in_the_circle() -> None:
    crate = box(1.0, 0.5, (1.0, 1.0, 1.0))
    free = circle(floor(8, 6), crate)
    assert free is not None
    nearest_m = np.clip([free.x_m, free.y_m], [0.5, 0.0], [1.5, 1.0])
    distance_m = float(np.hypot(free.x_m - nearest_m[0], free.y_m - nearest_m[1]))
    assert free.radius_m <= distance_m
    assert 1 < free.radius_m < 3


def test_walls_take_as_much_of_the_floor_on_each_of_four_sides() -> None:
    south = Thing("wall", quad((2, -2, 0), (-4, 0, 0), (0, 0, 2)), "grey")
    walls = [replace(south, mesh=moved(south.mesh, at(yaw=yaw_deg))) for yaw_deg in (0, 90, 180, 270)]
    faces = triangles(scene(floor(6, 6), *walls), t_ns=0)
    free = floor_map(faces, RayCaster(faces)).free
    assert 0 < np.count_nonzero(~free) < free.size / 4
    for turned in (np.rot90(free), np.rot90(free, 2), np.flipud(free)):
        np.testing.assert_array_equal(turned, free)


def test_a_body_does_not_fit_into_a_box_that_is_open_below() -> None:
    tent = box(0.0, 0.0, (3.0, 3.0, 2.0), z_m=0.05)
    solid = circle(floor(4, 4), tent)
    assert solid is not None
    assert max(abs(solid.x_m), abs(solid.y_m)) > 1.5


@pytest.mark.parametrize(("height_m", "is_free"), [(0.5, False), (0.62, True), (1.1, True)])
def test_what_hangs_lower_than_a_body_is_high_takes_the_floor_below_it(height_m: float, is_free: bool) -> None:
    free = circle(floor(4, 4), box(0.0, 0.0, (4.0, 4.0, 0.04), z_m=height_m))
    if is_free:
        assert free is not None
        assert free.radius_m == pytest.approx(2 - CELL_M / 2)
    else:
        assert free is None or free.floor_m == pytest.approx(height_m + 0.04, abs=FLOOR_STEP_M)


def test_a_wall_without_a_back_blocks_from_its_front_too() -> None:
    screen = Thing("screen", quad((0.03, -2, 0), (0, 4, 0), (0, 0, 1)), "grey")
    free = circle(floor(4, 4), screen)
    assert free is not None
    assert abs(free.x_m - 0.03) >= free.radius_m


def test_the_floor_is_the_lowest_height_with_much_area() -> None:
    pit = floor(0.5, 0.5, x_m=4.0, z_m=-1.0)
    storey = floor(8, 8, z_m=3.0)
    free = circle(floor(6, 6), pit, storey)
    assert free is not None
    assert free.floor_m == 0
    landing = circle(floor(5, 5), pit, storey)  # 25 m², less than 40 % of 64 m²
    assert landing is not None
    assert landing.floor_m == 3
    deep = circle(floor(4, 4, z_m=-1.0), floor(6, 6))
    assert deep is not None
    assert deep.floor_m == -1


def test_a_slope_is_no_floor() -> None:
    slope = Thing("slope", quad((-2, -2, 0), (4, 0, 1.0), (0, 4, 0)), "grey")
    assert circle(slope) is None
    almost_level = Thing("ramp", quad((-2, -2, 0), (4, 0, 0.0), (0, 4, 0.01)), "grey")
    assert circle(almost_level) is not None


def test_a_floor_seen_from_below_is_none() -> None:
    assert circle(ceiling(4, 4, z_m=0.0)) is None


def test_a_long_floor_has_larger_cells() -> None:
    free = circle(floor(120, 4))
    assert free is not None
    cell_m = 120 / 600
    assert free.radius_m == pytest.approx((4 / cell_m / 2 - 0.5) * cell_m)


def test_rays_down_are_unit_vectors_along_minus_z() -> None:
    np.testing.assert_array_equal(downward_directions(3), [[0, 0, -1]] * 3)


def test_the_path_is_a_circle_around_the_centre_along_its_tangent() -> None:
    free = circle(floor(4, 4))
    assert free is not None
    path = circular_path(scene(floor(4, 4)))
    radius_m = 0.6 * free.radius_m
    offsets_m = np.array([pose.position_m for pose in path.poses]) - [free.x_m, free.y_m, free.floor_m]
    np.testing.assert_allclose(np.hypot(offsets_m[:, 0], offsets_m[:, 1]), radius_m)
    np.testing.assert_allclose(offsets_m[:, 2], 0)
    angles_rad = np.unwrap(np.arctan2(offsets_m[:, 1], offsets_m[:, 0]))
    yaws_deg = np.array([pose.yaw_deg for pose in path.poses])
    np.testing.assert_allclose(yaws_deg, np.rad2deg(angles_rad) + 90)
    # Once around, counter-clockwise, at constant speed.
    assert angles_rad[-1] - angles_rad[0] == pytest.approx(2 * np.pi)
    times_s = np.array([pose.t_s for pose in path.poses])
    np.testing.assert_allclose(times_s * SPEED_MPS, (angles_rad - angles_rad[0]) * radius_m, atol=1e-12)
    assert times_s[0] == 0
    assert len(path.poses) == 16
    assert path.rate_hz == RATE_HZ


@pytest.mark.parametrize(("side_m", "radius_m"), [(6.0, 0.6 * 2.95), (30.0, 4.0)])
def test_a_long_path_ends_after_ten_metres_and_its_radius_has_a_limit(side_m: float, radius_m: float) -> None:
    path = circular_path(scene(floor(side_m, side_m)))
    length_m = path.poses[-1].t_s * SPEED_MPS
    assert length_m == pytest.approx(min(MOST_LENGTH_M, 2 * np.pi * radius_m))
    first_m = np.array(path.poses[0].position_m)
    quarter_m = next(pose for pose in path.poses if pose.yaw_deg >= 180)
    assert abs(first_m[0]) == pytest.approx(radius_m, abs=CELL_M)
    assert quarter_m.position_m[1] > 0.8 * radius_m


@pytest.mark.parametrize(("side_m", "radius"), [(0.4, "0.15"), (0.2, "0.05")])
def test_a_floor_too_small_for_a_path_is_refused_with_its_radius(side_m: float, radius: str) -> None:
    with pytest.raises(
        SuiteError, match=rf"no free path was found in 'yard' \(.* has a radius of {radius} m\); add tra"
    ):
        circular_path(scene(floor(2.5, side_m)))


def test_the_smallest_floor_with_a_path_has_one() -> None:
    path = circular_path(scene(floor(2.5, 0.6)))
    first_m, second_m = (np.array(path.poses[k].position_m) for k in (0, len(path.poses) // 2))
    assert np.linalg.norm(first_m - second_m) == pytest.approx(2 * 0.6 * 0.25, rel=0.02)


def test_a_scene_without_a_floor_is_refused_with_a_guess_at_the_reason() -> None:
    wall = Thing("wall", quad((0, -1, 0), (0, 2, 0), (0, 0, 2)), "grey")
    with pytest.raises(SuiteError, match="it has no level floor; is another axis up"):
        circular_path(scene(wall))


def test_the_path_of_ten_metres_takes_twenty_seconds_at_ten_frames_a_second() -> None:
    path = circular_path(scene(floor(30, 30)))
    assert path.poses[-1].t_s == pytest.approx(20)
    assert (path.rate_hz, path.ease_s) == (10, 1)


@pytest.mark.parametrize(("low_m", "high_m"), [(0.0, 0.15), (0.3, 0.4), (0.55, 0.65)])
def test_a_thin_sheet_at_any_height_of_a_body_blocks_it(low_m: float, high_m: float) -> None:
    sheet = Thing("sheet", quad((0.03, -2, low_m), (0, 4, 0), (0, 0, high_m - low_m)), "grey")
    free = circle(floor(4, 4), sheet)
    assert free is not None
    assert abs(free.x_m - 0.03) >= free.radius_m


def test_what_is_smaller_than_a_body_drives_in_is_refused_as_an_object() -> None:
    with pytest.raises(SuiteError, match=r"it is only 1\.9 m wide.*if it is an object, put it into a scene's YAML"):
        circular_path(scene(floor(1.9, 1.5)))
    assert circular_path(scene(floor(2.1, 1.5))).poses


def hills(side_m: float = 20.0) -> Thing:
    """A square of uneven ground around the origin."""
    steps_m = np.arange(-side_m / 2, side_m / 2 + 0.01, 0.5)
    x, y = np.meshgrid(steps_m, steps_m)
    return Thing("ground", sheet(np.stack([x, y, _hill_m(x, y)], axis=-1)), "grey")


def _hill_m(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    return 0.4 * np.sin(0.4 * x) + 0.3 * np.cos(0.3 * y)


@pytest.mark.parametrize("water_m", [0.8, 2.0])  # the ground is at 0.4 m: shallower or deeper than a body is high
def test_the_map_of_uneven_ground_has_its_heights_and_leaves_out_water_and_things(water_m: float) -> None:
    pond = floor(4, 4, x_m=5, y_m=5, z_m=water_m)
    faces = triangles(scene(hills(), pond, box(-5, -5, (1, 1, 2), z_m=-1)), t_ns=0)
    ground = floor_map(faces, RayCaster(faces))
    assert ground is not None
    assert ground.ground_m is not None
    expected_m = _hill_m(*np.meshgrid(ground.x_m, ground.y_m))
    assert np.abs(ground.ground_m - expected_m).max() < 0.02
    near = {name: int(np.abs(ground.x_m - x_m).argmin()) for name, x_m in (("pond", 5), ("box", -5), ("lawn", 0))}
    assert not ground.free[near["pond"], near["pond"]]
    assert not ground.free[near["box"], near["box"]]
    assert ground.free[near["lawn"], near["lawn"]]
    assert ground.free.mean() > 0.8


def test_the_circle_on_uneven_ground_is_as_high_as_the_highest_ground_in_it() -> None:
    free = circle(hills())
    assert free is not None
    assert free.radius_m > 9
    angles_rad = np.linspace(0, 2 * np.pi, 60)
    shares = np.linspace(0, 1, 20)[:, None]
    x_m = free.x_m + MOST_RADIUS_M * shares * np.cos(angles_rad)
    y_m = free.y_m + MOST_RADIUS_M * shares * np.sin(angles_rad)
    assert free.floor_m == pytest.approx(_hill_m(x_m, y_m).max(), abs=0.02)


def test_a_level_floor_with_hills_of_less_area_stays_a_floor() -> None:
    faces = triangles(scene(floor(40, 40), hills(10)), t_ns=0)
    level = floor_map(faces, RayCaster(faces))
    assert level is not None
    assert level.ground_m is None
    assert level.floor_m == 0
