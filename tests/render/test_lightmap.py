"""Every surface has a place of its own in the map of light."""

import numpy as np
import pytest

from vobench.render.lightmap import ATLAS_WIDTH, pack_atlas
from vobench.scene.surface import box, room

SURFACES = [
    *room((10, 7, 3), floor="a", wall="a", ceiling="a"),
    *box(np.array([1, 2, 0.5]), (0.5, 0.3, 1.0), yaw_deg=20, material="a"),
]


@pytest.mark.parametrize("spacing_m", [0.02, 0.1, 5.0])
def test_patches_do_not_overlap_and_lie_within_the_map(spacing_m: float) -> None:
    atlas = pack_atlas(SURFACES, spacing_m=spacing_m)
    taken = np.zeros((atlas.height, atlas.width), int)
    for chart in atlas.charts:
        taken[chart.window] += 1
    assert taken.max() == 1
    assert taken.sum() == sum(chart.rows * chart.columns for chart in atlas.charts)


@pytest.mark.parametrize("spacing_m", [0.02, 0.1, 5.0])
def test_samples_are_no_further_apart_than_asked_and_reach_both_edges(spacing_m: float) -> None:
    for surface, chart in zip(SURFACES, pack_atlas(SURFACES, spacing_m=spacing_m).charts, strict=True):
        u, v = chart.fractions()
        assert (u.min(), u.max(), v.min(), v.max()) == (0, 1, 0, 1)
        points = surface.at(u, v)
        for axis in (0, 1):
            assert np.linalg.norm(np.diff(points, axis=axis), axis=-1).max() <= spacing_m + 1e-9


def test_corners_are_looked_up_at_the_middle_of_their_samples() -> None:
    atlas = pack_atlas(SURFACES, spacing_m=0.1)
    for index, chart in enumerate(atlas.charts):
        first, _, last, _ = atlas.texture_coordinates(index) * (atlas.width, atlas.height)
        np.testing.assert_allclose(first, (chart.column + 0.5, chart.row + 0.5))
        np.testing.assert_allclose(last, (chart.column + chart.columns - 0.5, chart.row + chart.rows - 0.5))


def test_a_surface_wider_than_the_map_widens_the_map() -> None:
    atlas = pack_atlas(SURFACES[:1], spacing_m=0.003)
    assert atlas.width == atlas.charts[0].columns > ATLAS_WIDTH
