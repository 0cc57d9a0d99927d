"""What the sky gives is what its directions add up to; behind a pane it is seen through that pane alone."""

import numpy as np
import pytest

from tests.rendering.receivers import receivers, summed
from tests.rendering.rectangles import rectangle, room
from vobench.rendering.light_emitter import emitters
from vobench.rendering.sky_emitter import OpenSky, SkyPane
from vobench.rendering.visibility import Visibility
from vobench.scene.light import Sky
from vobench.scene.material import Material, pane_reflectance
from vobench.scene.triangles import Thing, triangle_table

MATERIALS = {"floor": Material(), "glass": Material("pane", eta=1.5, tint=0.9)}
FLOOR = rectangle(np.zeros(3), np.array([4.0, 0, 0]), np.array([0, 4.0, 0]), "floor")
X, Y, Z = np.eye(3)
UNIFORM = Sky("sky", 10_000.0, "uniform")


def visibility_of(*things: Thing) -> Visibility:
    faces = triangle_table(list(things), [-1] * len(things), [-1] * len(things))
    return Visibility(faces, MATERIALS, np.arange(len(faces)))


@pytest.mark.parametrize("kind", ["uniform", "overcast", "clear"])
@pytest.mark.parametrize("eta", [0.0, 1.5])
@pytest.mark.parametrize(
    "tilt",
    [
        (0.5, -0.3, 0.8),
        (-0.9, 0.4, -0.1),
        pytest.param((0.0, 0.0, 1.0), marks=pytest.mark.slow),
        pytest.param((0.0, 0.0, -1.0), marks=pytest.mark.slow),
    ],
)
def test_the_light_of_the_open_sky_is_the_sum_over_its_directions(
    kind: str, eta: float, tilt: tuple[float, float, float]
) -> None:
    sky = Sky("sky", 10_000.0, kind, np.array([0.5, 0.3, np.sqrt(0.66)]))
    (emitter,) = emitters(sky, visibility_of(FLOOR))
    texels = receivers(eta=eta, tilt=tilt).take(slice(0, 1))
    np.testing.assert_allclose(emitter.unshadowed_light(texels), summed(emitter, texels), rtol=0.01)


def test_a_room_with_a_skylight_has_one_pane_of_sky_and_the_open_sky() -> None:
    around = [side for side in room((4, 4, 3), floor="floor", wall="floor", ceiling="floor") if side.name != "ceiling"]
    skylight = rectangle(np.array([0, 0, 3.0]), np.array([4.0, 0, 0]), np.array([0, 4.0, 0]), "glass", "skylight")
    visibility = visibility_of(*around, skylight)
    pane, rest = emitters(UNIFORM, visibility)
    assert isinstance(pane, SkyPane)
    assert isinstance(rest, OpenSky)
    assert (pane.sky, rest.sky) == ("pane", "open")

    # Straight up, rays pass the pane; they count for the pane alone.
    up = np.array([[0.0, 0, 10.0]], np.float32)
    origin = np.array([[0.0, 0, 1.0]], np.float32)
    assert pane.transmittance(visibility, origin, up)[0] == 1
    assert rest.transmittance(visibility, origin, up)[0] == 0


def test_a_skylight_lights_the_room_below_it_and_nothing_above_it() -> None:
    around = [side for side in room((4, 4, 3), floor="floor", wall="floor", ceiling="floor") if side.name != "ceiling"]
    skylight = rectangle(np.array([0, 0, 3.0]), np.array([4.0, 0, 0]), np.array([0, 4.0, 0]), "glass", "skylight")
    pane, _ = emitters(UNIFORM, visibility_of(*around, skylight))
    below_and_above_m = np.array([[0.0, 0, 1.0], [0.0, 0, 4.0]], np.float32)
    assert pane.may_reach(below_and_above_m).tolist() == [True, False]


def test_a_pane_that_stands_in_the_open_lights_both_sides() -> None:
    pane, _ = emitters(UNIFORM, visibility_of(FLOOR, rectangle(X + Z, Y, Z, "glass")))
    beside_m = np.array([[0.0, 0, 1.0], [2.0, 0, 1.0]], np.float32)
    assert pane.may_reach(beside_m).all()


def test_a_pane_far_above_gives_its_solid_angle_times_what_it_lets_through() -> None:
    height_m = 30.0
    pane = rectangle(np.array([0, 0, height_m]), np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), "glass")
    emitter, _ = emitters(UNIFORM, visibility_of(pane))
    texels = receivers(eta=0.0).take(slice(0, 5))
    texels.points_m[:] = 0
    transmittance = 0.9 * (1 - float(pane_reflectance(np.array(1.0), 1.5)))
    luminance_cd_m2 = float(UNIFORM.luminance_cd_m2(np.array([[0.0, 0, 1.0]]))[0])
    np.testing.assert_allclose(summed(emitter, texels), luminance_cd_m2 * transmittance / height_m**2, rtol=0.01)
