"""Models are read as their makers meant them, to the last corner, or refused in a sentence that helps."""

import json
import struct
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from tests.asset.glb import CORNERS, Glb, Json, Reader, only, triangle, z_up
from vobench.asset import gltf_material
from vobench.asset.model import read_model
from vobench.errors import ModelError
from vobench.geometry.triangle import face_normals
from vobench.scene.light import PointLight, SpotLight, Sun
from vobench.scene.material import linear

# Nodes and faces


def test_a_triangle_stands_upright_and_looks_south(read: Reader) -> None:
    mesh = only(read(triangle()))
    np.testing.assert_array_equal(mesh.triangles, [[[0, 0, 0], [1, 0, 0], [0, 0, 1]]])
    np.testing.assert_array_equal(face_normals(mesh.triangles), [[0, -1, 0]])
    np.testing.assert_array_equal(mesh.vertex_normals, [[0, -1, 0]] * 3)


def test_nodes_turn_scale_and_move_what_is_below_them(read: Reader) -> None:
    half = np.sqrt(0.5)
    glb = triangle(nodes=[{"rotation": [0, half, 0, half], "scale": [2, 3, 4]}])  # 90° about y: x to -z, z to x
    glb.tree["nodes"].append({"name": "group", "translation": [10, 20, 30], "children": [0]})
    corners = only(read(glb, scale=0.1)).triangles[0]
    np.testing.assert_allclose(corners, z_up([[10, 20, 30], [10, 20, 28], [10, 23, 30]]) * 0.1, atol=1e-6)


def test_a_matrix_says_the_same_as_its_parts(read: Reader) -> None:
    parts = {"translation": [1, 2, 3], "rotation": [0.5, 0.5, 0.5, 0.5], "scale": [1, 2, 3]}
    turn = np.array([[0, 0, 1], [1, 0, 0], [0, 1, 0]])  # 120° about the diagonal
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn * [1, 2, 3], [1, 2, 3]
    first, second = read(triangle(nodes=[parts])), read(triangle(nodes=[{"matrix": matrix.T.ravel().tolist()}]))
    np.testing.assert_allclose(only(first).triangles, only(second).triangles, atol=1e-12)


def test_a_mirrored_node_keeps_its_front_in_front(read: Reader) -> None:
    mesh = only(read(triangle(nodes=[{"scale": [-1, 1, 1]}])))
    np.testing.assert_allclose(mesh.triangles.mean(1), [[-1 / 3, 0, 1 / 3]])
    np.testing.assert_allclose(face_normals(mesh.triangles), [[0, -1, 0]], atol=1e-12)
    np.testing.assert_allclose(mesh.vertex_normals, [[0, -1, 0]] * 3, atol=1e-12)


def test_strips_and_fans_are_the_faces_of_a_list_that_says_them_all(read: Reader) -> None:
    points = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 2, 0]]
    strip, fan = Glb(), Glb()
    for glb, mode, corners in ((strip, 5, points), (fan, 6, [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [-1, 1, 0]])):
        glb.tree |= {"meshes": [{"primitives": [glb.primitive(corners, mode=mode)]}], "nodes": [{"mesh": 0}]}
        mesh = only(read(glb))
        assert len(mesh.faces) == 3
        np.testing.assert_allclose(face_normals(mesh.triangles), [[0, -1, 0]] * 3)
    expected = z_up(np.array(points, float)[[[0, 1, 2], [1, 3, 2], [2, 3, 4]]])
    np.testing.assert_array_equal(np.sort(only(read(strip)).triangles, 1), np.sort(expected, 1))


def test_normals_of_the_file_bend_a_flat_face_and_missing_ones_do_not(read: Reader) -> None:
    glb = Glb(nodes=[{"mesh": 0}])
    bent = np.array([[0, 0.6, 0.8], [0, 0, 1], [0.6, 0, 0.8]])
    glb.tree["meshes"] = [{"primitives": [glb.primitive(NORMAL=glb.numbers(bent))]}]
    np.testing.assert_allclose(only(read(glb)).vertex_normals, z_up(bent), atol=1e-7)
    glb.tree["meshes"] = [{"primitives": [glb.primitive(NORMAL=glb.numbers(bent * [[1], [0], [np.nan]]))]}]
    np.testing.assert_allclose(only(read(glb)).vertex_normals, [z_up(bent[0]), [0, -1, 0], [0, -1, 0]], atol=1e-7)


def test_sparse_numbers_replace_those_they_name(read: Reader) -> None:
    glb = triangle()
    at, new = glb.view(np.array([1], np.uint16).tobytes()), glb.view(np.array([5, 0, 0], np.float32).tobytes())
    sparse = {"count": 1, "indices": {"bufferView": at, "componentType": 5123}, "values": {"bufferView": new}}
    glb.tree["accessors"][0]["sparse"] = sparse
    np.testing.assert_array_equal(only(read(glb)).triangles[0], z_up([[0, 0, 0], [5, 0, 0], [0, 1, 0]]))


def test_interleaved_and_normalised_numbers_are_what_they_stand_for(read: Reader) -> None:
    glb = Glb(nodes=[{"mesh": 0}], materials=[{}])
    rows = np.zeros(3, np.dtype([("at", "<i2", 3), ("pad", "<i2"), ("uv", "<u2", 2)]))
    rows["at"], rows["uv"] = np.array(CORNERS) * 32767, [[0, 0], [65535, 0], [0, 32768]]
    view = glb.view(rows.tobytes(), byteStride=12)
    shared = {"bufferView": view, "count": 3, "normalized": True}
    glb.tree["accessors"] = [
        {**shared, "componentType": 5122, "type": "VEC3"},
        {**shared, "componentType": 5123, "type": "VEC2", "byteOffset": 8},
    ]
    glb.tree["meshes"] = [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}}]}]
    mesh = only(read(glb))
    np.testing.assert_array_equal(mesh.triangles[0], z_up(CORNERS))
    np.testing.assert_allclose(mesh.visual.uv, [[0, 0], [1, 0], [0, 32768 / 65535]], atol=1e-12)


def test_instances_stand_where_they_are_told_each_with_a_name(read: Reader) -> None:
    glb = triangle(nodes=[{"translation": [0, 0, 1]}], extensionsRequired=["EXT_mesh_gpu_instancing"])
    at = {"TRANSLATION": glb.numbers([[1, 0, 0], [2, 0, 0]]), "SCALE": glb.numbers([[1, 1, 1], [2, 2, 2]])}
    glb.tree["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": at}}
    things = read(glb).things
    assert [thing.name for thing in things] == ["tile", "tile_2"]
    np.testing.assert_allclose(things[0].mesh.triangles[0], z_up([[1, 0, 1], [2, 0, 1], [1, 1, 1]]))
    np.testing.assert_allclose(things[1].mesh.triangles[0], z_up([[2, 0, 1], [4, 0, 1], [2, 2, 1]]))


def test_names_are_unique_and_things_in_the_order_of_their_paths(read: Reader) -> None:
    nodes = [{"name": name} for name in ("cup", "cup_2", "cup", "ant", "")]
    model = read(triangle(nodes=nodes))
    assert [thing.name for thing in model.things] == ["ant", "cup", "cup_3", "cup_2", "node_4"]
    swapped = read(triangle(nodes=nodes[::-1]))
    assert [thing.name for thing in swapped.things][:4] == ["ant", "cup", "cup_3", "cup_2"]
    twins = triangle(nodes=[{"name": "cup", "translation": [n, 0, 0]} for n in range(3)])
    twins.tree["nodes"].append({"name": "tray", "children": [0, 1, 2]})
    assert [thing.mesh.vertices[0, 0] for thing in read(twins).things] == [0, 1, 2]


def test_a_skin_is_taken_as_its_joints_stand(read: Reader) -> None:
    glb = Glb()
    joints, weights = (
        glb.numbers([[0, 1, 0, 0]] * 3, "uint8"),
        glb.numbers([[1, 0, 0, 0], [0, 1, 0, 0], [0.5, 0.5, 0, 0]]),
    )
    glb.tree["materials"] = [{}]
    glb.tree["meshes"] = [{"primitives": [glb.primitive(JOINTS_0=joints, WEIGHTS_0=weights, material=0)]}]
    binds = np.stack([np.eye(4), np.eye(4)])
    binds[1, 3, :3] = [0, 0, -1]  # columns first: joint 1 was bound at z = 1
    glb.tree["skins"] = [{"joints": [1, 2], "inverseBindMatrices": glb.numbers(binds.reshape(2, 16))}]
    nodes = [{"name": "person", "mesh": 0, "skin": 0, "translation": [9, 9, 9]}]  # where the node is does not matter
    glb.tree["nodes"] = [*nodes, {"translation": [1, 0, 0], "children": [2]}, {"translation": [0, 2, 1]}]
    model = read(glb)
    np.testing.assert_allclose(only(model).triangles[0], z_up([[1, 0, 0], [2, 2, 0], [1, 2, 0]]), atol=1e-6)
    assert model.notes == ("node 'person': skin read in the pose of the file",)


# Materials


def material_of(read: Reader, source: Json, **more: Any) -> Any:
    (material,) = read(triangle(material={"name": "stuff", **source}, **more)).materials.values()
    return material


def test_a_shiny_body_has_its_colour_coat_roughness_and_metal(read: Reader) -> None:
    surface = {"baseColorFactor": [0.1, 0.2, 0.3, 1], "metallicFactor": 0.25, "roughnessFactor": 0.5}
    stuff = material_of(read, {"pbrMetallicRoughness": surface})
    assert (stuff.kind, stuff.colour, stuff.eta) == ("body", (0.1, 0.2, 0.3), 1.5)
    assert (stuff.roughness, stuff.metal, stuff.cutout) == (0.25, 0.25, None)
    assert (
        material_of(read, {"pbrMetallicRoughness": surface, "extensions": {"KHR_materials_ior": {"ior": 1.3}}}).eta
        == 1.3
    )


def test_what_is_too_rough_to_mirror_is_matt_in_its_colour(read: Reader) -> None:
    stuff = material_of(read, {"pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 1]}})  # metal, by default
    assert (stuff.colour, stuff.eta, stuff.metal, stuff.roughness) == ((0.1, 0.2, 0.3), 1.0, 0.0, 0.0)


def test_what_has_neither_material_nor_colours_is_grey_and_said_so(read: Reader) -> None:
    glb = Glb(nodes=[{"mesh": 0}])
    glb.tree["meshes"] = [{"primitives": [glb.primitive()]}]
    model = read(glb)
    assert [look.colour for look in model.materials.values()] == [(0.5, 0.5, 0.5)]
    assert model.notes == ("surfaces without a material are read as grey and diffuse",)
    assert material_of(read, {}).colour == (1, 1, 1)  # as glTF has it


def test_emission_is_factor_times_strength_in_candela_per_square_metre(read: Reader) -> None:
    strong = {"KHR_materials_emissive_strength": {"emissiveStrength": 4000}}
    assert material_of(read, {"emissiveFactor": [1, 0.5, 0], "extensions": strong}).emission_cd_m2 == (4000, 2000, 0)
    weak = read(triangle(material={"name": "lamp", "emissiveFactor": [1, 1, 1]}))
    assert weak.materials["lamp"].emission_cd_m2 == (1, 1, 1)
    assert "material 'lamp' gives 1 cd/m²" in weak.notes[0]


def test_a_picture_lies_with_its_first_row_at_v_0_and_is_one_value_for_all_who_show_it(read: Reader) -> None:
    glb = Glb(nodes=[{"mesh": 0}])
    pixels = np.arange(4 * 2 * 3).reshape(2, 4, 3) * 10
    info = glb.texture(pixels)
    glb.tree["materials"] = [
        {"pbrMetallicRoughness": {"baseColorTexture": info}, "emissiveTexture": info, "emissiveFactor": [1, 1, 1]}
    ]
    uv = [[0, 0], [1, 0], [0, 1]]
    glb.tree["meshes"] = [{"primitives": [glb.primitive(material=0, TEXCOORD_0=glb.numbers(uv))]}]
    model = read(glb)
    (stuff,) = model.materials.values()
    np.testing.assert_array_equal(stuff.texture.pixels(), pixels)
    assert stuff.texture is stuff.emission_texture
    assert stuff.texture.tile_m == 1
    np.testing.assert_array_equal(only(model).visual.uv, uv)


def test_a_texture_is_turned_as_the_example_of_its_extension_says(read: Reader) -> None:
    # KHR_texture_transform: "utilizes only the lower left quadrant of the source image, rotated clockwise 90°".
    glb = Glb(nodes=[{"mesh": 0}])
    turned = {"offset": [0, 1], "rotation": np.pi / 2, "scale": [0.5, 0.5], "texCoord": 1}
    info = {**glb.texture(np.zeros((2, 2, 3))), "extensions": {"KHR_texture_transform": turned}}
    glb.tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": info}}]
    sets = {"TEXCOORD_0": glb.numbers(np.full((3, 2), 7)), "TEXCOORD_1": glb.numbers([[0, 0], [1, 0], [0, 1]])}
    glb.tree["meshes"] = [{"primitives": [glb.primitive(material=0, **sets)]}]
    np.testing.assert_allclose(only(read(glb)).visual.uv, [[0, 1], [0, 0.5], [0.5, 1]], atol=1e-12)


def test_metal_and_roughness_are_the_means_of_their_texture(read: Reader) -> None:
    glb = triangle(material={})
    pixels = np.zeros((2, 2, 3))
    pixels[0, :, 1], pixels[:, :, 2] = 102, 51  # green 40 % on half of it, blue 20 %
    glb.tree["materials"] = [{"pbrMetallicRoughness": {"metallicRoughnessTexture": glb.texture(pixels)}}]
    model = read(glb)
    (stuff,) = model.materials.values()
    assert (stuff.roughness, stuff.metal) == pytest.approx((0.04, 0.2))
    assert model.notes == ("material 'material_0' is 20% metal and 20% rough, the means of its texture",)


def blended(read: Reader, opacity: Any, mode: str, alpha: float = 1.0, **more: Any) -> tuple[Any, tuple[str, ...]]:
    glb = triangle(material={})
    pixels = np.full((*np.shape(opacity), 4), 200)
    pixels[..., 3] = opacity
    surface = {"baseColorTexture": glb.texture(pixels), "baseColorFactor": [1, 1, 1, alpha]}
    glb.tree["materials"] = [{"name": "stuff", "pbrMetallicRoughness": surface, "alphaMode": mode, **more}]
    model = read(glb)
    return model.materials["stuff"], model.notes


def test_a_mask_cuts_holes_where_the_opacity_is_below_its_cutoff(read: Reader) -> None:
    stuff, _ = blended(read, [[0, 255]], "MASK", alpha=0.8, alphaCutoff=0.4)
    assert stuff.cutout == pytest.approx(0.5)  # of the texture alone
    assert stuff.texture.pixels().shape == (1, 2, 4)


def test_what_is_blended_is_a_pane_or_cut_out_or_solid(read: Reader) -> None:
    glass, notes = blended(read, [[51, 51]], "BLEND")
    assert (glass.kind, glass.eta) == ("pane", 1.5)
    assert glass.tint == pytest.approx(0.8)
    assert notes == ("material 'stuff' is 20% opaque: a pane",)
    leaf, notes = blended(read, [[0, 255, 255]], "BLEND")
    assert (leaf.kind, leaf.cutout, len(notes)) == ("body", 0.5, 1)
    solid, notes = blended(read, [[204, 230]], "BLEND")
    assert (solid.kind, solid.cutout, len(notes)) == ("body", None, 1)
    opaque, notes = blended(read, [[0, 10]], "OPAQUE")
    assert (opaque.texture.pixels().shape, opaque.cutout, notes) == ((1, 2, 3), None, ())
    gone, _ = blended(read, [[0, 0]], "BLEND")
    assert (gone.kind, gone.eta, gone.tint) == ("pane", 1.0, 1.0)


def test_transmission_makes_a_pane_in_its_tone(read: Reader) -> None:
    more = {"KHR_materials_transmission": {"transmissionFactor": 1}}
    glass = material_of(read, {"extensions": more, "pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 0.5, 1]}})
    assert (glass.kind, glass.eta, glass.tint) == ("pane", 1.5, pytest.approx(0.5))


# Colours by vertex


def coloured(colours: Any, kind: str = "float32", **more: Any) -> Glb:
    glb = Glb(nodes=[{"mesh": 0}], materials=[{"name": "paint", **more}])
    at = glb.numbers(colours, kind, normalized=kind != "float32")
    glb.tree["meshes"] = [{"primitives": [glb.primitive(material=0, COLOR_0=at)]}]
    return glb


def test_one_colour_for_all_vertices_is_the_materials(read: Reader) -> None:
    surface = {"baseColorFactor": [0.5, 1, 1, 1]}
    model = read(coloured([[51, 102, 255, 255]] * 3, "uint8", pbrMetallicRoughness=surface))
    assert model.materials["paint"].colour == pytest.approx((0.1, 0.4, 1.0))


def test_colours_run_straight_from_corner_to_corner(read: Reader) -> None:
    colours = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
    model = read(coloured(colours))
    mesh, picture = only(model), linear(model.materials["paint"].texture.pixels())
    height, width = picture.shape[:2]
    for share in ([1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.5, 0], [0, 0.5, 0.5], [0.2, 0.3, 0.5]):
        u, v = share @ mesh.visual.uv[mesh.faces[0]]
        x, y = u * width - 0.5, v * height - 0.5
        i, j = int(y + 1e-9), int(x + 1e-9)
        rows = (1 - (y - i)) * picture[i] + (y - i) * picture[i + 1]
        seen = (1 - (x - j)) * rows[j] + (x - j) * rows[j + 1]
        # Where two corners of full colours meet, no colour beyond their edge could hold the third at nothing.
        np.testing.assert_allclose(seen, share @ colours, atol=0.06 if share == [0, 0.5, 0.5] else 0.01)


def test_many_faces_of_many_colours_each_show_their_own(read: Reader) -> None:
    rng = np.random.default_rng(3)
    glb = Glb(nodes=[{"mesh": 0}])
    corners = rng.uniform(-1, 1, (300, 3))
    colours = np.repeat(rng.uniform(0, 1, (100, 3)), 3, axis=0)
    glb.tree["meshes"] = [{"primitives": [glb.primitive(corners, COLOR_0=glb.numbers(colours))]}]
    model = read(glb)
    picture = linear(model.materials["default"].texture.pixels())
    mesh = only(model)
    place = (mesh.visual.uv * picture.shape[:2]).astype(int)
    np.testing.assert_allclose(picture[place[:, 1], place[:, 0]], colours, atol=0.006)


# Roles and lights


def test_a_mover_has_its_things_about_its_own_origin(read: Reader) -> None:
    glb = triangle(nodes=[{"name": "door", "translation": [0, 0, -1]}, {"name": "wall"}])
    glb.tree["nodes"].append(
        {"name": "hinge", "translation": [2, 1, 0], "children": [0], "extras": {"vobench": "mover"}}
    )
    model = read(glb)
    assert [thing.name for thing in model.things] == ["wall"]
    (door,) = model.movers
    assert (door.name, [thing.name for thing in door.things]) == ("hinge", ["door"])
    np.testing.assert_allclose(door.origin_m, z_up([2, 1, 0]))
    np.testing.assert_allclose(door.things[0].mesh.triangles[0], z_up([[0, 0, -1], [1, 0, -1], [0, 1, -1]]))
    np.testing.assert_allclose(model.all_things[1].mesh.triangles[0], z_up([[2, 1, -1], [3, 1, -1], [2, 2, -1]]))


def test_a_lamp_is_named_and_one_without_light_is_refused(read: Reader) -> None:
    strong = {"KHR_materials_emissive_strength": {"emissiveStrength": 4000}}
    glow = {"emissiveFactor": [1, 1, 1], "extensions": strong}
    lamp = triangle(material=glow, nodes=[{"name": "bulb"}, {"name": "shade", "mesh": 1}, {"name": "ceiling"}])
    lamp.tree["meshes"].append({"primitives": [lamp.primitive()]})
    lamp.tree["nodes"].append({"name": "Lamp", "children": [0, 1]})
    assert read(lamp, roles={"Lamp": "lamp"}).lamps == ("bulb",)
    with pytest.raises(ModelError, match=r"node 'tile': is a lamp without light; set its emissiveFactor"):
        read(triangle(), roles={"tile": "lamp"})


def lights(read: Reader, *sources: Json, **node: Any) -> Any:
    glb = triangle(
        extensions={"KHR_lights_punctual": {"lights": list(sources)}}, extensionsUsed=["KHR_lights_punctual"]
    )
    for nth in range(len(sources)):
        at = {"extensions": {"KHR_lights_punctual": {"light": nth}}}
        glb.tree["nodes"].append({"name": f"light{nth}", **at, **node})
    return read(glb).lights


def test_lights_keep_their_candela_and_lux_and_shine_along_their_minus_z(read: Reader) -> None:
    point, spot, sun = lights(
        read,
        {"type": "point", "intensity": 100, "color": [1, 0.5, 0]},
        {"type": "spot", "intensity": 800, "spot": {"innerConeAngle": 0.2, "outerConeAngle": 0.5}},
        {"type": "directional", "intensity": 50_000},
        translation=[1, 2, 3],
        scale=[5, 5, 5],
        rotation=[-np.sqrt(0.5), 0, 0, np.sqrt(0.5)],  # -z turned to -y, down
    )
    assert isinstance(point, PointLight)
    assert point.power_lm == pytest.approx(4 * np.pi * 100)
    assert (point.name, point.colour) == ("light0", (1, 0.5, 0))
    np.testing.assert_allclose(point.position_m, z_up([1, 2, 3]))
    assert isinstance(spot, SpotLight)
    np.testing.assert_allclose(spot.direction, [0, 0, -1], atol=1e-12)
    towards = np.array([[0, 0, -1], [0, np.sin(0.19), -np.cos(0.19)], [0, np.sin(0.51), -np.cos(0.51)]])
    np.testing.assert_allclose(spot.intensity_cd(towards), [800, 800, 0], rtol=1e-6)
    assert isinstance(sun, Sun)
    assert sun.illuminance_lx == 50_000
    np.testing.assert_allclose(sun.direction(0), [0, 0, 1], atol=1e-12)
    (level,) = lights(read, {"type": "directional"})
    np.testing.assert_allclose(level.direction(0), [0, -1, 0], atol=1e-12)  # its light goes north


# Faults


def with_nan() -> Glb:
    glb = Glb(nodes=[{"name": "tile", "mesh": 0}])
    glb.tree["meshes"] = [{"primitives": [glb.primitive([[0, 0, np.nan], [1, 0, 0], [0, 1, 0]])]}]
    return glb


def changed(key: str, value: Any, *, of: str | None = None, **more: Any) -> Glb:
    glb = triangle(**more)
    (glb.tree[of][0] if of else glb.tree)[key] = value
    return glb


def of_index(vertex: int) -> Glb:
    glb = Glb(nodes=[{"name": "tile", "mesh": 0}])
    glb.tree["meshes"] = [{"primitives": [glb.primitive(faces=[[0, 1, vertex]])]}]
    return glb


def of_picture(**image: Any) -> Glb:
    glb = triangle(material={"name": "wood", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}})
    glb.tree |= {"textures": [{"source": 0}], "images": [image or {"bufferView": glb.view(b"no image")}]}
    return glb


def of_huge_picture() -> Glb:
    header = struct.pack(">II5B", 60_000, 60_000, 8, 2, 0, 0, 0)
    chunks = [(b"IHDR", header), (b"IDAT", b""), (b"IEND", b"")]
    import zlib

    png = b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in chunks
    )
    glb = of_picture()
    glb.tree["images"] = [{"bufferView": glb.view(png), "name": "poster"}]
    return glb


FAULTS: dict[str, tuple[Callable[[], Glb | bytes], str]] = {
    "an empty file": (lambda: b"", "is empty"),
    "another format": (lambda: b"\x7fELF" + bytes(100), "begins like neither .glb nor .gltf"),
    "half a file": (
        lambda: triangle().bytes()[:-20],
        "has 428 of 448 bytes, or they are damaged; copy or export it again",
    ),
    "broken JSON": (lambda: triangle().bytes().replace(b'"nodes":', b'"nodes" ;'), "does not conform to glTF 2.0"),
    "glTF 1": (lambda: changed("asset", {"version": "1.0"}), "is glTF 1.0, not 2; gltf-pipeline"),
    "Draco": (
        lambda: changed("extensionsRequired", ["KHR_draco_mesh_compression"]),
        "by Draco; decompress it: gltf-tr",
    ),
    "meshopt": (lambda: changed("extensionsRequired", ["EXT_meshopt_compression"]), "by meshopt; decompress it: gltf-"),
    "the unknown": (lambda: changed("extensionsRequired", ["X_y"]), "needs the extension X_y, which is unknown here"),
    "no data": (
        lambda: changed("bufferView", None, of="accessors") and no_data(),
        "accessor 0 has no data; if it is",
    ),
    "no faces": (lambda: changed("nodes", []), "has no visible faces"),
    "NaN": (with_nan, "node 'tile': has vertices at NaN or infinity; repair it where it was made"),
    "an index too large": (lambda: of_index(3), "node 'tile': a face has vertex 3 of 3"),
    "a mesh too many": (lambda: changed("mesh", 4, of="nodes"), "number 4 of 1 meshes is requested"),
    "bytes that are not there": (lambda: changed("count", 4000, of="accessors"), "byte 48,000 of 36 is requested"),
    "5 million faces": (
        lambda: changed("count", 15_000_000, of="accessors"),
        "has 5,000,000 faces, more than 1,000,000",
    ),
    "a loop": (
        lambda: changed("children", [0], of="nodes", scenes=[{"nodes": [0]}]),
        "node 'tile': is in the tree twice",
    ),
    "two parents": (
        lambda: triangle(nodes=[{}, {"children": [0]}, {"children": [0]}]),
        "'tile': is in the tree twice",
    ),
    "a role": (
        lambda: triangle(nodes=[{"extras": {"vobench": "miror"}}]),
        "no role named 'miror'. Did you mean 'mirror'?",
    ),
    "a matrix": (
        lambda: triangle(nodes=[{"matrix": [1, 2]}]),
        r"node 'tile': expected 16 finite numbers, found \[1, 2\]",
    ),
    "a lost image": (
        lambda: of_picture(uri="a%20b.png"),
        "material 'wood': image .*: needs 'a b.png', which is not",
    ),
    "no image": (of_picture, "node 'tile': material 'wood': image '0': cannot be read .*; save it as PNG of"),
    "a huge image": (
        of_huge_picture,
        "image 'poster': cannot be read .*3600000000 pixels.*; save it as PNG of 67,108,864 pixels at most",
    ),
    "far away": (lambda: triangle(nodes=[{"scale": [1e9, 1, 1]}]), "node 'tile': reaches 1e\\+09 m; is it damaged"),
}


def no_data() -> Glb:
    glb = triangle()
    del glb.tree["accessors"][0]["bufferView"]
    return glb


@pytest.mark.parametrize("fault", FAULTS)
def test_what_cannot_be_read_is_refused_in_one_sentence_with_its_file(read: Reader, tmp_path: Path, fault: str) -> None:
    make, sentence = FAULTS[fault]
    with pytest.raises(ModelError, match=sentence) as error:
        read(make())
    assert str(error.value).startswith(str(tmp_path / "thing.glb"))
    assert "\n" not in str(error.value)


def test_a_glob_that_names_nothing_is_refused_with_what_there_is(read: Reader) -> None:
    with pytest.raises(ModelError, match=r"no node named 'til'. Did you mean 'tile'?"):
        read(triangle(), roles={"til": "mirror"})


@pytest.mark.parametrize("few_faces", [False, True])
def test_a_model_is_refused_for_its_size_before_memory_is_taken(read: Reader, *, few_faces: bool) -> None:
    glb = triangle(nodes=[{"name": f"n{n}"} for n in range(50)])
    if few_faces:
        glb.tree["meshes"][0]["primitives"][0]["indices"] = glb.numbers([0, 1, 2], "uint16")
    glb.tree["accessors"][0] |= {"count": 2_999_999, "sparse": {}}
    del glb.tree["accessors"][0]["bufferView"]
    tracemalloc.start()
    with pytest.raises(ModelError, match="more than 1,000,000"):
        read(glb)
    assert tracemalloc.get_traced_memory()[1] < 5e6
    tracemalloc.stop()


def test_buffers_and_pictures_beside_a_gltf_are_read(read: Reader, tmp_path: Path) -> None:
    glb = of_picture(uri="a%20b.png")
    (tmp_path / "all.bin").write_bytes(glb.blob)
    Image.new("RGB", (3, 2), (1, 2, 3)).save(tmp_path / "a b.png")
    glb.tree["buffers"] = [{"uri": "all.bin", "byteLength": len(glb.blob)}]
    model = read(json.dumps(glb.tree).encode(), "thing.gltf")
    np.testing.assert_array_equal(only(model).triangles, only(read(triangle())).triangles)
    np.testing.assert_array_equal(model.materials["wood"].texture.pixels(), np.tile([1, 2, 3], (2, 3, 1)))
    (tmp_path / "all.bin").unlink()
    with pytest.raises(ModelError, match=r"needs 'all.bin', which is not beside it; put it there, or export one .glb"):
        read_model(tmp_path / "thing.gltf")


def test_many_large_pictures_are_made_smaller(read: Reader, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gltf_material, "MOST_TEXELS", 16 * 16)
    glb = triangle(material={})
    glb.tree["materials"] = [{"pbrMetallicRoughness": {"baseColorTexture": glb.texture(np.full((64, 32, 3), 7))}}]
    model = read(glb)
    (stuff,) = model.materials.values()
    assert model.notes == ("1 of its textures are reduced to fit into memory",)
    assert stuff.texture is not None
    assert stuff.texture.pixels().shape == (16, 8, 3)


def test_damaged_files_are_read_or_refused_and_never_anything_else(read: Reader) -> None:
    glb = coloured([[1, 0, 0], [0, 1, 0], [0, 0, 1]], emissiveFactor=[1, 1, 1])
    surface = {"baseColorTexture": glb.texture(np.zeros((4, 4, 4))), "baseColorFactor": [1, 1, 1, 1]}
    glb.tree["materials"][0] |= {"pbrMetallicRoughness": surface, "alphaMode": "MASK", "doubleSided": True}
    glb.tree["nodes"][0] |= {"rotation": [0, 0, 0, 1], "children": [1], "extras": {"vobench": "mover"}}
    glb.tree["nodes"].append({"scale": [1, 2, 3], "extensions": {"KHR_lights_punctual": {"light": 0}}, "mesh": 0})
    glb.tree["extensions"] = {"KHR_lights_punctual": {"lights": [{"type": "spot", "intensity": 10}]}}
    whole, rng = glb.bytes(), np.random.default_rng(5)
    assert len(read(whole).movers) == 1
    tracemalloc.start()
    outcomes = []
    for trial in range(600):
        damaged = bytearray(whole)
        if trial % 5 == 0:
            damaged = damaged[: rng.integers(len(whole))]
        else:
            for at in rng.integers(len(whole), size=rng.integers(1, 4)):
                damaged[at] = rng.integers(256) if trial % 2 else ord("0123456789-e.[]{}"[rng.integers(17)])
        try:
            read(bytes(damaged))
            outcomes.append("read")
        except ModelError as error:
            assert "\n" not in str(error)  # noqa: PT017
            outcomes.append("refused")
    assert tracemalloc.get_traced_memory()[1] < 1e9
    tracemalloc.stop()
    assert {outcomes.count("read") > 40, outcomes.count("refused") > 40} == {True}


# OBJ, STL, PLY


def test_an_obj_stands_upright_with_the_colour_of_its_material(read: Reader, tmp_path: Path) -> None:
    (tmp_path / "paint.mtl").write_text("newmtl red\nKd 1 0 0\nNs 900\n")
    text = "mtllib paint.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n"
    model = read(text.encode(), "thing.obj")
    np.testing.assert_allclose(only(model).triangles[0], z_up(CORNERS))
    np.testing.assert_allclose(only(model).vertex_normals, [[0, -1, 0]] * 3)
    assert model.materials["red"].colour == pytest.approx((1, 0, 0))
    assert (model.materials["red"].metal, model.materials["red"].eta) == (0, 1.5)
    assert model.notes[0] == ".obj has no unit and no axes: one unit was read as 1 m, and y as up"
    assert model.things[0].name == "thing.obj"


def test_an_obj_whose_picture_is_lost_is_refused(read: Reader, tmp_path: Path) -> None:
    text = b"mtllib paint.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n"
    (tmp_path / "paint.mtl").write_text("newmtl red\nmap_Kd wood.png\n")
    with pytest.raises(ModelError, match=r"needs 'wood.png', which is not beside it; put it there, or export one .glb"):
        read(text, "thing.obj")


def test_an_obj_without_its_material_file_is_grey_with_a_note(read: Reader) -> None:
    text = b"mtllib paint.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n"
    model = read(text, "thing.obj")
    (material,) = model.materials.values()
    assert material.colour == (0.5, 0.5, 0.5)
    assert "its material file 'paint.mtl' is not beside it: read as grey and diffuse" in model.notes


def test_a_picture_of_an_obj_has_its_first_row_at_v_0(read: Reader, tmp_path: Path) -> None:
    Image.fromarray(np.arange(12, dtype=np.uint8).reshape(2, 2, 3)).save(tmp_path / "wood.png")
    (tmp_path / "paint.mtl").write_text("newmtl red\nKd 0 0 0\nmap_Kd wood.png\n")
    uv = "vt 0 1\nvt 1 1\nvt 0 0\n"  # the first corner at the upper left
    model = read(f"mtllib paint.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\n{uv}usemtl red\nf 1/1 2/2 3/3\n".encode(), "thing.obj")
    mesh = only(model)
    np.testing.assert_allclose(mesh.visual.uv[mesh.faces[0]], [[0, 0], [1, 0], [0, 1]], atol=1e-12)
    picture = model.materials["red"].texture
    assert picture is not None
    np.testing.assert_array_equal(picture.pixels().ravel(), np.arange(12))


def stl(corners: Any) -> bytes:
    faces = np.zeros(len(corners), np.dtype([("n", "<f4", 3), ("at", "<f4", (3, 3)), ("x", "<u2")]))
    faces["at"] = corners
    return bytes(80) + struct.pack("<I", len(faces)) + faces.tobytes()


def test_an_stl_is_z_up_and_a_torn_one_refused(read: Reader) -> None:
    data = stl([CORNERS, [[0, 0, 0], [0, 1, 0], [0, 0, 1]]])
    model = read(data, "thing.stl", scale=2.0)
    np.testing.assert_allclose(only(model).triangles[0], 2 * np.array(CORNERS))
    np.testing.assert_allclose(only(model).vertex_normals[[0, 3]], [[0, 0, 1], [1, 0, 0]], atol=1e-12)
    np.testing.assert_allclose(only(read(data, "thing.stl", up="y")).triangles[0], z_up(CORNERS))
    with pytest.raises(ModelError, match="has 174 bytes, but its head states 184: is it cut off"):
        read(data[:-10], "thing.stl")
    with pytest.raises(ModelError, match="has 5,000,000 faces"):
        read(data[:80] + struct.pack("<I", 5_000_000) + data[84:], "thing.stl")


def test_a_ply_has_the_colours_of_its_vertices(read: Reader) -> None:
    head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    head += "property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\n"
    body = "property list uchar int vertex_indices\nend_header\n0 0 0 9 9 9\n1 0 0 9 9 9\n0 1 0 9 9 9\n3 0 1 2\n"
    model = read((head + body).encode(), "thing.ply")
    assert next(iter(model.materials.values())).colour == pytest.approx((float(linear(np.uint8(9))),) * 3, abs=1e-6)
    with pytest.raises(ModelError, match="has 2,500,000 faces, more than 1,000,000"):
        read(head.replace("vertex 3", "vertex 5000000").encode(), "thing.ply")
    with pytest.raises(ModelError, match="has no visible faces"):
        read((head + body)[:-20].encode(), "thing.ply")


def test_a_file_of_another_kind_and_none_at_all_are_refused(read: Reader, tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=r"is of an unknown format; known formats are .glb, .gltf, .obj, .stl, .ply"):
        read(b"x", "thing.fbx")
    with pytest.raises(ModelError, match=r"nothing.glb: there is no such file"):
        read_model(tmp_path / "nothing.glb")
