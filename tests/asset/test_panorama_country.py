"""Country has fields of few colours around a meadow, and trees in rows beyond the nearest things."""

import numpy as np

from tests.asset.canvases import NEAREST_M, canvas
from tests.asset.test_panorama_suburb import Recorder
from vobench.asset.panorama_country import FIELD_ALBEDOS, MEADOW_M, _add_row_of_trees, _ground_albedo
from vobench.asset.panorama_ground import LAWN, ground_places


def test_the_scene_is_on_a_meadow_and_fields_are_of_their_colours():
    empty = canvas()
    x_m, y_m, footprint_m = ground_places(empty)
    distance_m = np.hypot(x_m, y_m)
    albedo = _ground_albedo(empty) / np.exp(empty.grass(x_m, y_m, footprint_m))[..., None]
    meadow = albedo[distance_m < NEAREST_M + MEADOW_M - 1]
    np.testing.assert_allclose(meadow, np.broadcast_to(np.float32(LAWN), meadow.shape), rtol=1e-4)
    fields = albedo[(distance_m > NEAREST_M + MEADOW_M + 1) & (footprint_m < 20)]
    apart = np.abs(fields[::97, None] - FIELD_ALBEDOS).max(axis=-1).min(axis=-1)
    assert apart.max() < 1e-4


def test_trees_stand_in_rows_beyond_the_nearest_things():
    scenery = Recorder()
    _add_row_of_trees(canvas(2), scenery)
    trees_m = np.array(scenery.trees_m)
    assert len(trees_m) > 5
    assert np.linalg.norm(trees_m, axis=1).min() > NEAREST_M
    spread_m = np.linalg.svd(trees_m - trees_m.mean(axis=0), compute_uv=False)
    assert spread_m[1] < 0.3 * spread_m[0]


def test_a_seed_repeats_its_rows():
    rows = []
    for seed in (5, 5, 6):
        scenery = Recorder()
        _add_row_of_trees(canvas(seed), scenery)
        rows.append(np.array(scenery.trees_m))
    np.testing.assert_array_equal(rows[0], rows[1])
    assert rows[0].shape != rows[2].shape or (rows[0] != rows[2]).any()
