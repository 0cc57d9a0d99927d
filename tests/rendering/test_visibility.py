"""How much light passes: nothing through walls, each pane's share through panes, both ways alike."""

import numpy as np
import pytest

from tests.rendering.rectangles import rectangle
from vobench.rendering.visibility import Visibility
from vobench.scene.material import Material, pane_reflectance
from vobench.scene.triangles import triangle_table

MATERIALS = {
    "wall": Material(),
    "glass": Material("pane", eta=1.5, tint=0.9),
    "mirror": Material("mirror", tint=0.7),
    "brushed": Material("mirror", tint=0.7, roughness=0.2),
}
U, V = np.array([0, 4.0, 0]), np.array([0, 0, 4.0])


def seen(*places: tuple[float, str]) -> Visibility:
    """Large squares across the x axis, each at a place."""
    things = [rectangle(np.array([x, 0, 0]), U, V, material, f"{nth}") for nth, (x, material) in enumerate(places)]
    faces = triangle_table(things, [-1] * len(things), [-1] * len(things))
    return Visibility(faces, MATERIALS, np.arange(len(faces)))


START = np.array([[0.0, 0.1, 0.2]], np.float32)
AHEAD = np.array([[5.0, 0.3, -0.4]], np.float32)
COSINE = 5 / np.sqrt(25.25)


@pytest.mark.parametrize("count", [0, 1, 2, 3])
def test_each_pane_lets_its_share_through_and_the_way_back_is_as_clear(count: int) -> None:
    visibility = seen((9.0, "wall"), *((1.0 + nth, "glass") for nth in range(count)))
    share = 0.9 * (1 - float(pane_reflectance(np.array(COSINE), 1.5)))
    assert visibility.transmittance(START, AHEAD)[0] == pytest.approx(share**count, rel=1e-5)
    assert visibility.transmittance(START + AHEAD, -AHEAD)[0] == pytest.approx(share**count, rel=1e-5)


def test_a_wall_stops_all_light_but_a_segment_that_ends_before_it_is_clear() -> None:
    visibility = seen((3.0, "wall"), (1.0, "glass"))
    assert visibility.transmittance(START, AHEAD)[0] == 0
    assert not visibility.is_unoccluded(START, AHEAD)[0]
    assert visibility.is_unoccluded(START, AHEAD / 2)[0]
    assert visibility.transmittance_of_panes(START, AHEAD)[0] < 1


def test_the_first_pane_of_a_ray_is_the_nearest_one() -> None:
    visibility = seen((3.0, "glass"), (1.0, "glass"), (2.0, "glass"))
    segments = np.concatenate([AHEAD, AHEAD * [[-1, 1, 1]]]).astype(np.float32)
    rays, hits = visibility.first_panes(np.repeat(START, 2, 0), segments, np.ones(2, np.float32))
    assert rays.tolist() == [0]
    assert visibility.faces.thing[hits.face].tolist() == [1]
    assert hits.distance[0] == pytest.approx(0.2)


def test_only_smooth_mirrors_show_lamps_and_only_panes_before_the_sky_are_lamps() -> None:
    visibility = seen((1.0, "mirror"), (2.0, "brushed"), (3.0, "glass"))
    assert [(patch.faces.tolist(), tint) for patch, tint, _ in visibility.mirrors] == [([0, 1], pytest.approx(0.7))]
    assert len(visibility.sky_panes) == 1
    assert visibility.crosses_sky_pane(START + np.array([[2.5, 0, 0]]), AHEAD).tolist() == [True]
    assert visibility.crosses_sky_pane(START + np.array([[3.5, 0, 0]]), AHEAD).tolist() == [False]
