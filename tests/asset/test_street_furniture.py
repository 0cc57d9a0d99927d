"""Street furniture: it stands on the ground, has the stated size, and varies with the seed."""

from collections.abc import Callable

import numpy as np
import pytest

from vobench.asset import street_furniture
from vobench.asset.furniture import Part
from vobench.asset.picture import Rng
from vobench.geometry.se3 import Array


def vertices_m(parts: list[Part]) -> Array:
    return np.concatenate([part.arrays.vertices_m for part in parts])


@pytest.mark.parametrize(
    ("make", "height_m"),
    [
        (street_furniture.traffic_sign, street_furniture.SIGN_POLE_M),
        (street_furniture.cable_cabinet, 1.2),
        (street_furniture.bicycle_hoop, 1.02),
    ],
)
def test_it_stands_on_the_ground_and_has_its_height(make: Callable[[Rng], list[Part]], height_m: float) -> None:
    points_m = vertices_m(make(np.random.default_rng(0)))
    assert points_m[:, 2].min() == pytest.approx(0, abs=0.03)
    assert points_m[:, 2].max() == pytest.approx(height_m, abs=0.03)


def test_the_tyres_touch_the_ground() -> None:
    tyres = street_furniture._tyres()
    assert tyres.vertices_m[:, 2].min() == pytest.approx(0, abs=0.005)


def test_bicycles_stand_on_both_sides_of_the_hoop() -> None:
    parts = street_furniture.bicycle_hoop(np.random.default_rng(0))
    y_m = vertices_m(parts)[:, 1]
    assert y_m.min() == pytest.approx(-y_m.max())


def test_seeds_differ_in_the_text_of_signs() -> None:
    textures = set()
    for seed in range(40):
        front = street_furniture.traffic_sign(np.random.default_rng(seed))[-1]
        texture = front.material.texture
        assert texture is not None
        textures.add(texture.pixels().tobytes())
    assert len(textures) == len(street_furniture.SIGNS)
