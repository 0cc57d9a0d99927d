"""Surfaces that are rebuilt from keyframes show the same things from the same places."""

import numpy as np
import pytest

from tests.analysis.pictures import DISPARITY_PX, STEP_PX, pair, view
from tests.analysis.test_keyframe_depth import shots_along_the_wall
from vobench.analysis import reconstruction
from vobench.analysis.keyframe_depth import keyframes_of, view_geometry
from vobench.analysis.reconstruction import reconstruct
from vobench.analysis.recorded_place import recorded_scene
from vobench.asset.luminous_model import Surface, write_luminous_model
from vobench.rendering.geometry import RayCaster
from vobench.scene.scene import triangles
from vobench.suite.scene_build import build

SHOTS = 5


@pytest.fixture(scope="module")
def surfaces() -> list[Surface]:
    keyframes = keyframes_of(shots_along_the_wall(SHOTS), pair(), view_geometry(pair()), most_disparity_px=30)
    return reconstruct(keyframes, view_geometry(pair()))


@pytest.fixture(scope="module")
def caster(surfaces: list[Surface], tmp_path_factory: pytest.TempPathFactory) -> RayCaster:
    model = tmp_path_factory.mktemp("recorded") / "recorded.glb"
    write_luminous_model(surfaces, model)
    return RayCaster(triangles(build(recorded_scene(model), {})))


def wall_m() -> float:
    return pair().focal_baseline / DISPARITY_PX


def test_every_ray_between_the_keyframes_ends_at_the_wall(caster: RayCaster) -> None:
    geometry = view_geometry(pair())
    rays = geometry.rays(geometry.pixel_grid()).reshape(-1, 3)
    step_m = pair().baseline_m * STEP_PX / DISPARITY_PX
    for position in (0.0, 0.5, 2.3, SHOTS - 1.0):
        origins_m = np.tile([position * step_m, 0, 0], (len(rays), 1))
        lengths = np.linalg.norm(rays, axis=1)
        hits = caster.hits(origins_m, rays / lengths[:, None])
        depth_m = hits.distance / lengths
        assert (hits.face >= 0).all()
        assert np.mean(np.abs(depth_m / wall_m() - 1) < 0.05) > 0.95


def test_what_one_keyframe_shows_no_other_shows_again(surfaces: list[Surface]) -> None:
    near_m2 = 0.0
    columns_m = []
    for surface in surfaces:
        corners_m = surface.vertices_m[surface.faces]
        is_near = corners_m[:, :, 2].max(1) < 1.2 * wall_m()
        edges_m = np.diff(corners_m[is_near], axis=1)
        near_m2 += float(np.linalg.norm(np.cross(edges_m[:, 0], edges_m[:, 1]), axis=1).sum()) / 2
        columns_m += [corners_m[is_near][:, :, 0].min(initial=0), corners_m[is_near][:, :, 0].max(initial=0)]
    rows_m = np.concatenate(
        [surface.vertices_m[:, 1] for surface in surfaces if surface.vertices_m[:, 2].max() < 2 * wall_m()]
    )
    seen_m2 = (max(columns_m) - min(columns_m)) * np.ptp(rows_m)
    assert near_m2 < 1.5 * seen_m2


def test_a_place_of_many_faces_has_a_coarser_grid(surfaces: list[Surface], monkeypatch: pytest.MonkeyPatch) -> None:
    fine = sum(len(surface.faces) for surface in surfaces)
    most = fine // 3
    monkeypatch.setattr(reconstruction, "MOST_FACES", most)
    keyframes = keyframes_of(shots_along_the_wall(SHOTS), pair(), view_geometry(pair()), most_disparity_px=30)
    coarse = sum(len(surface.faces) for surface in reconstruct(keyframes, view_geometry(pair())))
    assert most / 3 < coarse <= most


def test_textures_are_those_of_the_keyframes_without_noise(surfaces: list[Surface]) -> None:
    margin_px = (surfaces[0].texture.shape[1] - view(0, 0).shape[1]) // 2
    centre = surfaces[0].texture[margin_px:-margin_px, margin_px:-margin_px]
    differences_dn = [np.abs(centre.astype(float) - shot.left).mean() for shot in shots_along_the_wall(SHOTS)]
    assert min(differences_dn) < 1.5
