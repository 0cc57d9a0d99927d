"""Cameras stand in the free space of a place and look along its path, or stand around an object and look at it."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.asset.shape import at, block
from vobench.geometry.camera import Pinhole
from vobench.rendering.geometry import RayCaster
from vobench.scene.mesh import flipped, moved, quad
from vobench.scene.triangles import Thing, Triangles, triangle_table
from vobench.suite.free_space import LEAST_RADIUS_M, FreeCircle, largest_free_circle
from vobench.suite.viewpoint import EYE_SHARE, Viewpoint, around, is_place, viewpoints

LENS = Pinhole(8, 6, 4.0, 4.0, 3.5, 2.5)


def faces_of(*meshes) -> Triangles:
    things = [Thing("thing", mesh, "grey") for mesh in meshes]
    none = [-1] * len(things)
    return triangle_table(things, none, none)


def room(height_m: float = 2.5):
    return moved(flipped(block((6, 5, height_m), bevel_m=0)), at(z_m=height_m / 2))


def test_a_viewpoint_looks_along_its_yaw_and_down_by_its_pitch() -> None:
    view = Viewpoint((1.0, 2.0, 3.0), 90.0, 30.0)
    T = view.T_world_camera()
    np.testing.assert_allclose(T[:3, 3], [1, 2, 3])
    ahead = T[:3, 2]
    np.testing.assert_allclose(ahead, [0, np.cos(np.pi / 6), -0.5], atol=1e-12)
    rays = view.rays(LENS)
    assert rays.shape == (48, 3)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=1), 1)
    mean = rays.mean(0)
    np.testing.assert_allclose(mean / np.linalg.norm(mean), ahead, atol=1e-9)


def test_cameras_of_a_room_are_in_it_and_look_to_all_sides() -> None:
    faces = faces_of(room())
    views = viewpoints(faces, RayCaster(faces))
    eyes_m = np.array([view.eye_m for view in views])
    assert (np.abs(eyes_m[:, :2]) < [3, 2.5]).all()
    assert set(eyes_m[:, 2].round(9)) == {0.4, 1.2}
    headings = {round(view.yaw_deg % 360) for view in views}
    assert headings == set(range(0, 360, 45))


def test_cameras_stay_below_a_low_ceiling() -> None:
    faces = faces_of(room(height_m=1.0))
    eyes_m = np.array([view.eye_m for view in viewpoints(faces, RayCaster(faces))])
    assert eyes_m[:, 2].max() == pytest.approx(EYE_SHARE * 1.0, abs=1e-3)


def test_cameras_stay_below_every_face_of_a_ceiling_the_first_of_all_faces_too() -> None:
    ceiling = quad((-3, -2.5, 1.0), (0, 5, 0), (6, 0, 0))  # seen from below
    faces = faces_of(ceiling, room(height_m=2.5))
    eyes_m = np.array([view.eye_m for view in viewpoints(faces, RayCaster(faces))])
    assert len(eyes_m) == 16
    assert (eyes_m[:, 2] < 1.0).all()


def test_all_of_an_object_is_in_each_picture_around_it() -> None:
    low_m = np.array([1.0, 2.0, 0.0])
    high_m = np.array([1.4, 2.1, 0.3])
    corners_m = np.array([[x, y, z] for x in (1.0, 1.4) for y in (2.0, 2.1) for z in (0.0, 0.3)])
    wide = Pinhole(48, 32, 24.0, 24.0, 23.5, 15.5)
    views = around(low_m, high_m, count=4)
    assert len(views) == 4
    for view in views:
        T = view.T_world_camera()
        in_camera_m = (corners_m - T[:3, 3]) @ T[:3, :3]
        pixels = wide.project(in_camera_m)
        assert (in_camera_m[:, 2] > 0).all()
        assert ((pixels > 0) & (pixels < [47, 31])).all()


def test_cameras_around_an_object_move_with_it_and_look_at_its_middle_from_slightly_above() -> None:
    def of_box(x_m: float, y_m: float) -> list[Viewpoint]:
        faces = faces_of(moved(block((1.0, 0.5, 0.8), bevel_m=0), at(x_m, y_m, 0.4)))
        return viewpoints(faces, RayCaster(faces))

    middle_m = np.array([7.0, -3.0, 0.4])
    for view, at_origin in zip(of_box(7.0, -3.0), of_box(0.0, 0.0), strict=True):
        np.testing.assert_allclose(np.array(view.eye_m) - at_origin.eye_m, [7, -3, 0], atol=1e-9)
        to_middle = middle_m - view.eye_m
        ahead = view.T_world_camera()[:3, 2]
        np.testing.assert_allclose(ahead, to_middle / np.linalg.norm(to_middle), atol=1e-9)
        assert 10 < np.degrees(np.arcsin(-ahead[2])) < 30


def test_a_scene_without_free_space_or_with_a_gap_only_is_no_place() -> None:
    plain = faces_of(quad((-20, -20, 0), (40, 0, 0), (0, 40, 0)))
    caster = RayCaster(plain)
    gap = FreeCircle(0.0, 0.0, 0.0, LEAST_RADIUS_M / 2)
    assert not is_place(plain, caster, None)
    assert not is_place(plain, caster, gap)
    assert is_place(plain, caster, replace(gap, radius_m=2 * LEAST_RADIUS_M))


def test_a_chair_a_cube_and_a_roof_are_objects_and_a_room_and_a_plain_are_places() -> None:
    def counts_as_place(*meshes) -> bool:
        faces = faces_of(*meshes)
        caster = RayCaster(faces)
        return is_place(faces, caster, largest_free_circle(faces, caster))

    seat = quad((-0.4, -0.4, 0.5), (0.8, 0, 0), (0, 0.8, 0))
    tower = block((4, 4, 30), bevel_m=0)
    plain = quad((-20, -20, 0), (40, 0, 0), (0, 40, 0))
    assert not counts_as_place(seat)
    assert not counts_as_place(block((1, 1, 1), bevel_m=0))
    assert not counts_as_place(tower)
    assert counts_as_place(room())
    assert counts_as_place(plain)
