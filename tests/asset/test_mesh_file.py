"""Files of other formats: converted to .glb, a mesh keeps its corners, its unit, its orientation and its colours."""

import io
import struct

import numpy as np
import pytest
import trimesh
from PIL import Image

from vobench.asset import mesh_file
from vobench.asset.mesh_file import read_as_glb
from vobench.errors import ModelError

BOX_M = (0.5, 2.0, 0.03)
OBJ = """mtllib {library}
v 0 0 0
v 1 0 0
v 0 1 0
v 0 0 1
vt 0 0
vt 1 0
vt 0 1
usemtl brick
f 1/1 2/2 3/3
f 1/1 3/3 4/2
"""
MTL = "newmtl brick\nKd 0.8 0.4 0.2\n"


def box():
    return trimesh.creation.box(BOX_M)


def written(folder, name, data):
    path = folder / name
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return path


def converted(path):
    data, notes = read_as_glb(path)
    return trimesh.load_scene(io.BytesIO(data), file_type="glb"), notes


@pytest.mark.parametrize("kind", ["obj", "stl", "stl_ascii", "ply"])
def test_a_box_keeps_its_size_its_faces_and_its_outside(tmp_path, kind):
    data = box().export(file_type=kind)
    scene, notes = converted(written(tmp_path, f"box.{kind.removesuffix('_ascii')}", data))
    (mesh,) = scene.dump()
    assert notes == []
    np.testing.assert_allclose(scene.bounds, [-np.array(BOX_M) / 2, np.array(BOX_M) / 2], atol=1e-6)
    assert len(mesh.faces) == 12
    area_vectors = mesh.area_faces[:, None] * mesh.face_normals
    assert (area_vectors * mesh.triangles_center).sum() / 3 == pytest.approx(np.prod(BOX_M))


def test_the_ending_may_be_in_capitals(tmp_path):
    path = written(tmp_path, "BOX.STL", box().export(file_type="stl"))
    assert len(converted(path)[0].geometry) == 1


def test_vertices_of_an_obj_are_not_merged_or_moved(tmp_path):
    written(tmp_path, "brick.mtl", MTL)
    scene, _ = converted(written(tmp_path, "thing.obj", OBJ.format(library="brick.mtl")))
    (mesh,) = scene.dump()
    triangles = [[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 0], [0, 1, 0], [0, 0, 1]]]
    np.testing.assert_allclose(mesh.triangles, triangles)


def material_of(scene):
    (mesh,) = scene.geometry.values()
    return mesh.visual.material


def test_a_material_has_its_colour_and_its_name_and_is_no_metal(tmp_path):
    written(tmp_path, "brick.mtl", MTL)
    scene, notes = converted(written(tmp_path, "thing.obj", OBJ.format(library="brick.mtl")))
    material = material_of(scene)
    assert notes == []
    assert material.name == "brick"
    assert material.metallicFactor == 0
    np.testing.assert_allclose(material.baseColorFactor[:3] / 255, [0.8, 0.4, 0.2], atol=1 / 255)


def test_a_texture_is_not_multiplied_by_the_colour_of_its_material(tmp_path):
    grain = np.arange(48, dtype=np.uint8).reshape(4, 4, 3)
    Image.fromarray(grain).save(tmp_path / "grain.png")
    written(tmp_path, "brick.mtl", MTL + "map_Kd grain.png\n")
    scene, _ = converted(written(tmp_path, "thing.obj", OBJ.format(library="brick.mtl")))
    material = material_of(scene)
    assert material.baseColorFactor is None
    assert material.metallicFactor == 0
    np.testing.assert_array_equal(np.asarray(material.baseColorTexture)[..., :3], grain)


def test_a_missing_material_file_is_noted_and_its_surfaces_have_no_material(tmp_path):
    scene, notes = converted(written(tmp_path, "thing.obj", OBJ.format(library="gone.mtl")))
    assert notes == ["its material file 'gone.mtl' is not beside it: read as grey and diffuse"]
    (mesh,) = scene.geometry.values()
    assert mesh.visual.kind != "texture" or mesh.visual.material.baseColorFactor is None


@pytest.mark.parametrize("options", ["", "-s 2 2 2 "])
def test_a_missing_picture_is_refused_by_its_name(tmp_path, options):
    written(tmp_path, "brick.mtl", f"{MTL}  map_Kd {options}gone.png\n")
    with pytest.raises(ModelError, match=r"needs 'gone\.png', which is not beside it"):
        read_as_glb(written(tmp_path, "thing.obj", OBJ.format(library="brick.mtl")))


def test_vertices_of_a_ply_keep_their_colours(tmp_path):
    mesh = box()
    mesh.visual.vertex_colors = np.tile([200, 100, 50, 255], (8, 1))
    scene, _ = converted(written(tmp_path, "box.ply", mesh.export(file_type="ply")))
    (read,) = scene.geometry.values()
    np.testing.assert_array_equal(np.unique(read.visual.vertex_colors, axis=0), [[200, 100, 50, 255]])


CLAIMS = {
    "thing.stl": bytes(80) + struct.pack("<I", 1_000_001),
    "thing.ply": b"ply\nformat ascii 1.0\nelement vertex 3\nelement face 2000002\nend_header\n",
    "points.ply": b"ply\nformat ascii 1.0\nelement vertex 2000002\nelement face 1\nend_header\n",
}


@pytest.mark.parametrize("name", CLAIMS)
def test_a_file_that_claims_too_many_faces_is_refused_before_any_is_read(tmp_path, name):
    with pytest.raises(ModelError, match="has 1,000,001 faces, more than 1,000,000; make them fewer"):
        read_as_glb(written(tmp_path, name, CLAIMS[name]))


@pytest.mark.parametrize("kind", ["obj", "stl_ascii"])
def test_faces_of_text_are_counted_and_as_many_as_allowed_are_read(tmp_path, monkeypatch, kind):
    path = written(tmp_path, f"box.{kind.removesuffix('_ascii')}", box().export(file_type=kind))
    monkeypatch.setattr(mesh_file, "MOST_FACES", 12)
    assert len(converted(path)[0].dump()[0].faces) == 12
    monkeypatch.setattr(mesh_file, "MOST_FACES", 11)
    with pytest.raises(ModelError, match="has 12 faces, more than 11"):
        read_as_glb(path)


@pytest.mark.parametrize("name", ["thing.fbx", "thing", "thing.blend"])
def test_an_unknown_format_is_refused_with_those_that_are_known(tmp_path, name):
    with pytest.raises(ModelError, match=r"known formats are \.glb, \.gltf, \.obj, \.stl, \.ply"):
        read_as_glb(written(tmp_path, name, b"x"))


@pytest.mark.parametrize(
    ("kind", "message"),
    [
        ("stl", r"has 342 bytes, but its head states 684: is it cut off\? Export it as \.glb"),
        ("ply", r"trimesh cannot read it .*; export it as \.glb"),
    ],
)
def test_a_torn_file_is_refused_with_what_helps(tmp_path, kind, message):
    data = box().export(file_type=kind)
    path = written(tmp_path, f"torn.{kind}", data[: len(data) // 2])
    with pytest.raises(ModelError, match=message):
        read_as_glb(path)
