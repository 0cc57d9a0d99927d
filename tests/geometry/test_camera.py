"""Rays and projection undo each other for every model, and neither sees what the lens cannot."""

import cv2
import numpy as np
import pytest

from vobench.geometry.camera import (
    BrownConrady,
    Camera,
    DoubleSphere,
    Equirectangular,
    KannalaBrandt,
    Pinhole,
    pixel_grid,
)
from vobench.geometry.rig import PRESETS

LENS = Pinhole(72, 48, 65.83, 54.51, 35.2, 23.9)  # neither square pixels nor a central axis
RADTAN, FISHEYE = PRESETS["euroc"].left, PRESETS["fisheye"].left
PRESET_CAMERAS = {f"{name}_left": p.left for name, p in PRESETS.items()}
PRESET_CAMERAS |= {f"{name}_right": p.right for name, p in PRESETS.items() if p.right != p.left}
STRONG_CAMERAS: dict[str, Camera] = {
    "pinhole": LENS,
    "barrel": BrownConrady(752, 480, 350.0, 340.0, 371.3, 244.8, -0.32, 0.11, 4e-3, -3e-3, -0.015),
    "barrel_that_folds": BrownConrady(752, 480, 458.0, 457.0, 367.0, 248.0, -0.45, 0.0, 2e-3, 1e-3),
    "pincushion": BrownConrady(752, 480, 458.0, 457.0, 367.0, 248.0, 0.6, 0.3, -5e-3, 8e-3, 0.1),
    "moustache": BrownConrady(752, 480, 458.0, 457.0, 367.0, 248.0, -0.5, 0.6, 1e-3, 1e-3, -0.1),
    "equidistant": KannalaBrandt(512, 512, 170.0, 165.0, 255.5, 255.5, 0.0, 0.0, 0.0, 0.0),
    "fisheye_that_folds": KannalaBrandt(512, 512, 190.0, 190.0, 254.9, 256.9, 0.1, -0.1, 0.02, -0.004),
    "double_sphere": DoubleSphere(512, 512, 157.9, 157.8, 254.9, 256.9, -0.18, 0.59),
    "double_sphere_wide": DoubleSphere(512, 512, 200.0, 180.0, 254.9, 256.9, 0.4, 0.75),
    "double_sphere_flat": DoubleSphere(512, 512, 300.0, 310.0, 254.9, 256.9, 0.5, 0.3),
    "unified": DoubleSphere(512, 512, 150.0, 150.0, 254.9, 256.9, -0.3, 0.5),
    "equirectangular": Equirectangular(640, 320),
}
CAMERAS = PRESET_CAMERAS | STRONG_CAMERAS
FOLDING = ("barrel_that_folds", "moustache", "fisheye_that_folds", "double_sphere", "double_sphere_wide")

every_camera = pytest.mark.parametrize("camera", CAMERAS.values(), ids=list(CAMERAS))


def everywhere(count: int = 60_000) -> np.ndarray:
    """Directions (count, 3) all around, of any length."""
    rng = np.random.default_rng(2)
    return rng.normal(size=(count, 3)) * 10 ** rng.uniform(-3, 3, (count, 1))


@every_camera
def test_the_ray_through_a_pixel_projects_to_that_pixel_to_a_millionth(camera: Camera) -> None:
    grid = pixel_grid(camera)
    grid = np.concatenate([grid[::3].reshape(-1, 2), grid[-1], grid[:, -1]])  # every third row, and the farthest
    rays = camera.rays(grid)
    seen = np.isfinite(rays).all(-1)
    assert seen.mean() > 0.55
    error_px = np.abs(camera.project(rays[seen]) - grid[seen])
    assert error_px.max() < 1e-6


@every_camera
def test_a_point_lies_on_the_ray_through_its_pixel(camera: Camera) -> None:
    points = everywhere()
    uv = camera.project(points)
    known = np.isfinite(uv).all(-1)
    # A pixel a thousand pictures away is no use to anyone, and costs digits.
    known &= np.abs(np.where(known[:, None], uv, 0)).max(-1) < 1e4
    along = points[known] / np.linalg.norm(points[known], axis=-1, keepdims=True)
    again = camera.project(camera.rays(uv[known]))
    assert known.sum() > 3_000
    assert np.abs(again - uv[known]).max() < 1e-6
    apart = np.linalg.norm(camera.rays(uv[known]) - along, axis=-1)
    assert np.median(apart) < 1e-12
    assert apart.max() < 1e-4  # at the very fold, where a picture says little about directions


@every_camera
def test_rays_have_length_one_and_do_not_depend_on_how_many_are_asked_for(camera: Camera) -> None:
    grid = pixel_grid(camera)[::16, ::16]
    rays = camera.rays(grid)
    length = np.linalg.norm(rays, axis=-1)
    np.testing.assert_allclose(length[np.isfinite(length)], 1, atol=1e-14)
    np.testing.assert_allclose(rays[1, 2], camera.rays(grid[1, 2]), atol=1e-12)


@every_camera
def test_a_camera_that_sees_a_point_sees_it_at_any_distance(camera: Camera) -> None:
    directions = everywhere(2000)
    np.testing.assert_allclose(camera.project(directions * 3), camera.project(directions), rtol=1e-9, atol=1e-9)


@every_camera
def test_near_the_axis_every_camera_is_the_pinhole_of_its_matrix(camera: Camera) -> None:
    points = np.random.default_rng(3).uniform([-1e-3, -1e-3, 1], [1e-3, 1e-3, 1], (100, 3))
    homogeneous = points @ camera.K.T
    np.testing.assert_allclose(camera.project(points), homogeneous[:, :2] / homogeneous[:, 2:], atol=0.02)


@every_camera
def test_right_in_the_world_is_right_in_the_picture_and_down_is_down(camera: Camera) -> None:
    axis, right, down = camera.project([[0, 0, 1], [0.01, 0, 1], [0, 0.01, 1]])
    np.testing.assert_allclose(axis, camera.K[:2, 2], atol=1e-9)
    assert right[0] > axis[0] + 0.3
    assert down[1] > axis[1] + 0.3


@every_camera
def test_a_cameras_own_place_has_no_pixel(camera: Camera) -> None:
    assert np.isnan(camera.project([0.0, 0.0, 0.0])).all()


@pytest.mark.parametrize("camera", [LENS, RADTAN, STRONG_CAMERAS["pincushion"]])
def test_what_is_not_in_front_of_a_flat_picture_has_no_pixel(camera: Camera) -> None:
    assert np.isnan(camera.project([[0.1, 0.2, 0.0], [0.1, 0.2, -1.0]])).all()


@pytest.mark.parametrize("name", ["double_sphere", "double_sphere_wide", "unified", "equidistant"])
def test_a_fisheye_sees_things_beside_and_behind_itself(name: str) -> None:
    angle = np.deg2rad(95)
    assert np.isfinite(CAMERAS[name].project([np.sin(angle), 0, np.cos(angle)])).all()


def test_the_fisheye_of_the_presets_is_valid_past_a_half_turn_of_view() -> None:
    angle = np.deg2rad(np.arange(91, 180))
    points = np.stack([np.sin(angle), np.zeros(89), np.cos(angle)], -1)
    np.testing.assert_allclose(FISHEYE.rays(FISHEYE.project(points)), points, atol=1e-9)


@pytest.mark.parametrize("name", FOLDING)
@pytest.mark.parametrize("azimuth_deg", range(0, 360, 30))
def test_along_any_spoke_pixels_move_outwards_until_the_lens_sees_no_more(name: str, azimuth_deg: int) -> None:
    camera, azimuth = CAMERAS[name], np.deg2rad(azimuth_deg)
    angle = np.linspace(0, np.pi, 5000)[1:-1]
    points = np.stack([np.sin(angle) * np.cos(azimuth), np.sin(angle) * np.sin(azimuth), np.cos(angle)], -1)
    out = np.linalg.norm((camera.project(points) - camera.K[:2, 2]) / np.diag(camera.K)[:2], axis=-1)
    seen = np.isfinite(out)
    assert not seen.all()
    assert np.array_equal(seen, np.arange(len(seen)) < seen.sum()), "seen up to an angle, and not beyond"
    assert (np.diff(out[seen]) > 0).all()


@pytest.mark.parametrize("name", ["barrel_that_folds", "moustache"])
def test_the_fold_of_a_lens_is_where_its_jacobian_may_vanish_and_no_sooner(name: str) -> None:
    camera = CAMERAS[name]
    # Against the tangential terms is where it bends the most.
    x, y = camera.fold_radius * np.array([-camera.p2, -camera.p1])[:, None] / np.hypot(camera.p1, camera.p2)
    _, _, xx, xy, yy = camera._distorted(x, y)
    assert abs(np.linalg.eigvalsh([[xx[0], xy[0]], [xy[0], yy[0]]])[0]) < 1e-9


@pytest.mark.parametrize("name", ["barrel_that_folds", "moustache", "barrel", "pincushion"])
def test_places_up_to_the_fold_are_found_again(name: str) -> None:
    camera = CAMERAS[name]
    rng = np.random.default_rng(4)
    r = min(camera.fold_radius, 3.0) * (1 - 10.0 ** rng.uniform(-9, 0, 20_000))
    phi = rng.uniform(0, 2 * np.pi, 20_000)
    points = np.stack([r * np.cos(phi), r * np.sin(phi), np.ones_like(r)], -1)
    uv = camera.project(points)
    np.testing.assert_allclose(camera.project(camera.rays(uv)), uv, atol=1e-6)


@pytest.mark.parametrize("name", FOLDING)
def test_pixels_that_no_direction_leads_to_have_no_ray(name: str) -> None:
    far = np.array([[-3000.0, -3000.0], [5000.0, 250.0], [np.nan, 3.0]])
    assert np.isnan(CAMERAS[name].rays(far)).all()


def test_off_the_picture_of_all_directions_there_are_none() -> None:
    camera = CAMERAS["equirectangular"]
    assert np.isnan(camera.rays([[-0.6, 10], [639.6, 10], [10, -0.6], [10, 319.6]])).all()
    assert np.isfinite(camera.rays([[-0.5, 10], [639.5, 10], [10, -0.5], [10, 319.5]])).all()


def test_opencv_bends_a_line_as_brown_and_conrady_do() -> None:
    for camera in (RADTAN, STRONG_CAMERAS["moustache"], STRONG_CAMERAS["pincushion"]):
        d = np.array([camera.k1, camera.k2, camera.p1, camera.p2, camera.k3])
        points = np.random.default_rng(5).uniform([-0.4, -0.3, 1], [0.4, 0.3, 1], (500, 3))
        expected = cv2.projectPoints(points, np.zeros(3), np.zeros(3), camera.K, d)[0].reshape(-1, 2)
        np.testing.assert_allclose(camera.project(points), expected, atol=1e-9)
        criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 500, 1e-14)
        straight = cv2.undistortPoints(expected, camera.K, d, criteria=criteria).reshape(-1, 2)
        rays = camera.rays(expected)
        np.testing.assert_allclose(rays[:, :2] / rays[:, 2:], straight, atol=1e-8)


def test_opencv_bends_a_fisheye_as_kannala_and_brandt_do() -> None:
    d = np.array([FISHEYE.k1, FISHEYE.k2, FISHEYE.k3, FISHEYE.k4])
    points = np.random.default_rng(6).uniform([-2, -2, 1], [2, 2, 1], (1, 500, 3))
    expected = cv2.fisheye.projectPoints(points, np.zeros(3), np.zeros(3), FISHEYE.K, d)[0][0]
    np.testing.assert_allclose(FISHEYE.project(points[0]), expected, atol=1e-9)
    rays = FISHEYE.rays(expected)
    straight = cv2.fisheye.undistortPoints(expected[None], FISHEYE.K, d)[0]
    np.testing.assert_allclose(rays[:, :2] / rays[:, 2:], straight, atol=1e-6)


def test_a_double_sphere_without_either_shift_is_a_pinhole() -> None:
    plain = DoubleSphere(72, 48, 65.83, 54.51, 35.2, 23.9, 0.0, 0.0)
    points = np.random.default_rng(7).uniform([-2, -2, 0.1], [2, 2, 5], (500, 3))
    np.testing.assert_allclose(plain.project(points), LENS.project(points), atol=1e-11)
    np.testing.assert_allclose(plain.rays(pixel_grid(LENS)), LENS.rays(pixel_grid(LENS)), atol=1e-14)


def test_lenses_without_distortion_are_the_model_they_distort() -> None:
    numbers = (72, 48, 65.83, 54.51, 35.2, 23.9)
    points = np.random.default_rng(8).uniform([-2, -2, 0.1], [2, 2, 5], (500, 3))
    np.testing.assert_allclose(BrownConrady(*numbers, 0.0, 0.0).project(points), LENS.project(points), atol=1e-11)
    fisheye = KannalaBrandt(*numbers, 0.0, 0.0, 0.0, 0.0)
    out_px = np.linalg.norm((fisheye.project(points) - [35.2, 23.9]) / [65.83, 54.51], axis=-1)
    np.testing.assert_allclose(out_px, np.arctan2(np.hypot(*points.T[:2]), points[:, 2]), atol=1e-12)


def test_all_around_is_a_full_turn_of_columns_and_half_a_turn_of_rows() -> None:
    camera = Equirectangular(360, 180)
    ahead, right, behind, down = camera.project([[0, 0, 1], [1, 0, 0], [1e-12, 0, -1], [0, 1, 0]])
    np.testing.assert_allclose([ahead, right, behind], [[179.5, 89.5], [269.5, 89.5], [359.5, 89.5]], atol=1e-9)
    assert down[1] == pytest.approx(179.5)


def test_projection_is_the_camera_matrix_and_a_division_by_depth() -> None:
    points = np.random.default_rng(3).uniform([-2, -2, 0.1], [2, 2, 5], (50, 3))
    homogeneous = points @ LENS.K.T
    np.testing.assert_allclose(LENS.project(points), homogeneous[:, :2] / homogeneous[:, 2:], atol=1e-12)


def test_the_grid_holds_every_pixels_column_and_row() -> None:
    grid = pixel_grid(LENS)
    assert grid.shape == (48, 72, 2)
    np.testing.assert_array_equal(grid[0, 0], [0, 0])
    np.testing.assert_array_equal(grid[47, 3], [3, 47])


@pytest.mark.parametrize("seed", range(20))
def test_no_place_that_any_lens_sees_is_lost_on_the_way_back(seed: int) -> None:
    rng = np.random.default_rng(seed)
    k, p = rng.normal(0, [0.5, 0.4, 0.2]), rng.normal(0, 0.02, 2)
    camera = BrownConrady(752, 480, 450.0, 455.0, 370.0, 245.0, k[0], k[1], p[0], p[1], k[2])
    r = min(camera.fold_radius, 2.5) * np.sqrt(rng.uniform(0, 1, 2000)) * (1 - 1e-9)
    phi = rng.uniform(0, 2 * np.pi, 2000)
    uv = camera.project(np.stack([r * np.cos(phi), r * np.sin(phi), np.ones_like(r)], -1))
    assert np.isfinite(uv).all()
    assert np.abs(camera.project(camera.rays(uv)) - uv).max() < 1e-6
