"""The scene in a recording: its faces, what moves, and where its light is found."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from rerun.chunk import RrdReader

from vobench.report import rerun_scene
from vobench.report.rerun import save_trial
from vobench.report.rerun_scene import SceneMesh, _baked_folder, scene_mesh
from vobench.runner.folder import CASE, SEQUENCE, RunFolder
from vobench.scene.material import Material, srgb
from vobench.scene.scene import WaypointMotion


def rows(path, entity, *, static=False):
    """Every row of an entity as a dict of its columns."""
    chunks = [c for c in RrdReader(path).stream() if c.entity_path == entity and c.is_static == static]
    return [row for chunk in chunks for row in chunk.to_record_batch().to_pylist()]


def values(path, entity, column):
    """What a column holds at each frame that has it."""
    return {row["frame"]: row[column] for row in rows(path, entity) if row.get(column) is not None}


def mesh(count, mover):
    rng = np.random.default_rng(0)
    return SceneMesh(
        corners_m=rng.normal(size=(count, 3, 3)),
        light_uv=rng.uniform(size=(count, 3, 2)),
        light=np.zeros((4, 4, 3), np.uint8),
        colors=rng.integers(0, 255, (count, 3), dtype=np.uint8),
        mover=np.array(mover, np.int32),
    )


def test_a_mesh_has_three_corners_of_one_colour_for_each_selected_face():
    scene = mesh(3, [-1, 0, -1])
    shown = scene.mesh(scene.mover < 0)
    positions = np.array(shown.vertex_positions.as_arrow_array().to_pylist())
    np.testing.assert_allclose(positions, scene.corners_m[[0, 2]].reshape(-1, 3), rtol=1e-6)
    assert shown.triangle_indices.as_arrow_array().to_pylist() == [[0, 1, 2], [3, 4, 5]]
    colors = shown.vertex_colors.as_arrow_array().to_pylist()
    assert colors[0] == colors[1] == colors[2] != colors[3]
    assert len(shown.vertex_texcoords.as_arrow_array()) == 6


@pytest.fixture
def folder(tmp_path):
    run = RunFolder(tmp_path / "run")
    run.case("down").mkdir(parents=True)
    return run


def test_the_light_is_the_first_entry_of_the_store_that_is_there(folder, tmp_path):
    sequence = tmp_path / "store" / "sequences" / "key"
    sequence.mkdir(parents=True)
    (folder.case("down") / SEQUENCE).symlink_to(sequence)
    link = folder.case("down") / SEQUENCE
    assert _baked_folder(link) is None
    (sequence / "inputs.json").write_text(json.dumps({"needs": ["baked/gone", "baked/here"]}))
    assert _baked_folder(link) is None
    (tmp_path / "store" / "baked" / "here").mkdir(parents=True)
    assert _baked_folder(link) == tmp_path / "store" / "baked" / "here"


def test_a_case_without_a_scene_or_without_its_light_has_no_mesh(folder):
    assert scene_mesh(folder, "down") is None
    (folder.case("down") / CASE).write_text(json.dumps({"scene": {}, "lighting": {}}))
    assert scene_mesh(folder, "down") is None


def test_what_moves_is_a_mesh_of_its_own_that_goes_its_way(run_viewer, tmp_path):
    corners = np.arange(27.0).reshape(3, 3, 3)
    way = WaypointMotion(np.array([0.0, 1.0]), np.array([[1.0, 2, 3], [2, 0, 3]]), np.array([0.0, 90]))
    tones, light = np.zeros((3, 3), np.uint8), np.zeros((4, 4, 3), np.uint8)
    scene = SceneMesh(corners, np.zeros((3, 3, 2)), light, tones, np.array([-1, 0, -1], np.int32), (way,))
    save_trial(tmp_path / "moves.rrd", replace(run_viewer, scene=scene))
    (still,) = rows(tmp_path / "moves.rrd", "/world/scene", static=True)
    assert len(still["Mesh3D:vertex_positions"]) == 6
    (walker,) = rows(tmp_path / "moves.rrd", "/world/scene/mover_0", static=True)
    np.testing.assert_array_equal(walker["Mesh3D:vertex_positions"], corners[1])
    at = values(tmp_path / "moves.rrd", "/world/scene/mover_0", "Transform3D:translation")
    stamps = [frame.t_ns for frame in run_viewer.frames()]
    np.testing.assert_allclose([at[i][0] for i in range(12)], [way.pose(t)[:3, 3] for t in stamps], atol=1e-6)
    assert at[0] != at[11]


def test_the_light_map_is_white_at_its_percentile_and_small(monkeypatch):
    radiance = np.zeros((3000, 40, 3))
    radiance[:1000] = np.linspace(0.001, 2.0, 1000)[:, None, None]
    monkeypatch.setattr(rerun_scene, "_light_map", lambda light: radiance)
    texture = rerun_scene._light_texture(None)
    assert texture.shape == (1000, 14, 3)
    assert texture.dtype == np.uint8
    shown = radiance[::3, ::3]
    white = np.percentile(shown[shown > 0], 98)
    assert (texture[shown >= white] == 255).all()
    assert texture[shown < 0.9 * white].max() < 255
    np.testing.assert_array_equal(texture, srgb(shown / white))


def test_a_scene_without_light_is_black(monkeypatch):
    monkeypatch.setattr(rerun_scene, "_light_map", lambda light: np.zeros((8, 8, 3)))
    assert rerun_scene._light_texture(None).max() == 0


def test_faces_have_the_colour_of_their_material_and_grey_without_one():
    materials = {"red": Material(colour=(1.0, 0.0, 0.0))}
    faces = SimpleNamespace(
        things=[SimpleNamespace(material="red"), SimpleNamespace(material="none")], thing=np.array([1, 0, 0])
    )
    light = SimpleNamespace(scene=SimpleNamespace(materials=materials), faces=faces)
    assert rerun_scene._face_colors(light).tolist() == [[128, 128, 128], [255, 0, 0], [255, 0, 0]]
