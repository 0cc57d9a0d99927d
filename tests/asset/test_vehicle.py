"""Cars stand on their wheels, have the size of their shape, and show glass and lamps from outside."""

import numpy as np
import pytest

from vobench.asset.furniture import Part
from vobench.asset.vehicle import GLASS, RUBBER, SHAPES, parked_car
from vobench.geometry.se3 import Array
from vobench.geometry.triangle import face_normals


def vertices_m(parts: list[Part]) -> Array:
    return np.concatenate([part.arrays.vertices_m for part in parts])


@pytest.mark.parametrize("shape", sorted(SHAPES))
def test_a_car_has_the_size_of_its_shape_and_stands_on_the_ground(shape: str) -> None:
    parts = parked_car(np.random.default_rng(1), shape)
    low_m = vertices_m(parts).min(axis=0)
    high_m = vertices_m(parts).max(axis=0)
    car = SHAPES[shape]
    assert abs(low_m[2]) < 0.005
    assert high_m[2] == pytest.approx(car.height_m, abs=0.06)
    assert high_m[0] - low_m[0] == pytest.approx(car.length_m, abs=0.12)
    assert high_m[1] - low_m[1] < car.width_m + 0.45, "with its mirrors"
    tyres = [part for part in parts if part.material == RUBBER]
    assert len(tyres) == 4


@pytest.mark.parametrize("shape", sorted(SHAPES))
def test_windows_face_outwards(shape: str) -> None:
    (glass,) = (part.arrays for part in parked_car(np.random.default_rng(1), shape) if part.material == GLASS)
    a, b, c = glass.corners_m.swapaxes(0, 1)
    normals = np.cross(b - a, c - a)
    from_inside = (a + b + c) / 3 - [-0.2, 0.0, SHAPES[shape].waist_m - 0.4]
    assert (np.einsum("fk,fk->f", normals, from_inside) > 0).all()


@pytest.mark.parametrize("shape", sorted(SHAPES))
def test_the_shading_normals_of_a_car_are_on_the_visible_side_of_its_faces(shape: str) -> None:
    for part in parked_car(np.random.default_rng(1), shape):
        mesh = part.arrays
        shading_normals = mesh.normals[mesh.faces].mean(axis=1)
        cosines = np.einsum("fk,fk->f", shading_normals, face_normals(mesh.corners_m))
        assert (cosines > 0).all()


@pytest.mark.parametrize("shape", sorted(SHAPES))
def test_both_ends_of_the_body_are_visible_from_outside(shape: str) -> None:
    body = parked_car(np.random.default_rng(1), shape)[0].arrays
    normals = face_normals(body.corners_m)
    middles_x_m = body.corners_m[..., 0].mean(axis=1)
    is_end = np.abs(normals[:, 0]) > 0.9999
    is_front = middles_x_m > 0
    assert (is_end & is_front).any()
    assert (is_end & ~is_front).any()
    assert (normals[is_end & is_front, 0] > 0).all()
    assert (normals[is_end & ~is_front, 0] < 0).all()


def test_cars_of_other_seeds_have_other_plates_and_colours() -> None:
    cars = [parked_car(np.random.default_rng(seed), "saloon") for seed in range(6)]
    assert len({car[0].material for car in cars}) > 2
