"""What an emitter is taken for unless it says otherwise, and how wide spheres look."""

from dataclasses import dataclass

import numpy as np
import pytest

from tests.rendering.lit_floor import X, Y, Z, open_floor
from tests.rendering.receivers import receivers
from tests.rendering.rectangles import rectangle
from vobench.rendering.array_types import Floats
from vobench.rendering.emitter import Aim, Emitter, sphere_width_rad
from vobench.rendering.geometry import BoundingSphere
from vobench.rendering.texel import Texels


@dataclass(frozen=True, slots=True, eq=False)
class Unknown(Emitter):
    """An emitter of which nothing but its sphere is known."""

    ball: BoundingSphere

    def towards(self, texels: Texels) -> Aim:
        raise NotImplementedError

    def width_rad(self, points_m: Floats) -> Floats:
        return sphere_width_rad(self.ball, points_m)


EMITTER = Unknown(BoundingSphere(np.array([0.0, 0, 10.0]), 0.5))


def test_the_squared_width_of_a_distant_sphere_is_its_solid_angle() -> None:
    (width_rad,) = EMITTER.width_rad(np.zeros((1, 3), np.float32))
    solid_angle_sr = 2 * np.pi * (1 - np.sqrt(1 - 0.05**2))
    assert width_rad**2 == pytest.approx(solid_angle_sr, rel=2e-3)


def test_nothing_is_known_of_an_emitter_without_formulas_and_all_points_may_be_reached() -> None:
    texels = receivers(eta=0.0)
    assert np.isnan(EMITTER.unshadowed_light(texels)).all()
    assert EMITTER.may_reach(texels.points_m).all()
    assert EMITTER.least_side == 1
    assert not EMITTER.is_hard


def test_its_light_passes_where_nothing_is_in_the_way() -> None:
    roof = rectangle(Z, 2 * Y, 2 * X, "a", "roof")
    visibility = open_floor(roof)[2]
    origins_m = np.array([[0, 0, 0.5], [0, 0, 1.5]], np.float32)
    segments_m = EMITTER.ball.centre_m.astype(np.float32) - origins_m
    assert EMITTER.transmittance(visibility, origins_m, segments_m).tolist() == [0, 1]
