"""Nodes, faces and lights of glTF: transforms compose, faces keep their front, and lights keep their intensity."""

import numpy as np
import pytest

from tests.asset.glb import CORNERS, Glb, triangle
from vobench.asset import gltf
from vobench.asset.gltf import BARE, read_gltf
from vobench.errors import ModelError
from vobench.geometry import se3
from vobench.scene.light import PointLight, SpotLight, Sun
from vobench.scene.material import linear

LIST = 4
STRIP = 5
FAN = 6
IDENTITY = np.eye(4)
RNG = np.random.default_rng(4)


def read(glb, **settings):
    return read_gltf(glb.bytes(), None, **settings)


def nodes(glb, T_model_file=IDENTITY):
    return list(read(glb).nodes(T_model_file))


def by_name(glb, T_model_file=IDENTITY):
    return {node.names[-1]: node for node in nodes(glb, T_model_file)}


def primitives(glb, **settings):
    """The primitives of all nodes."""
    file = read(glb, **settings)
    everything = list(file.nodes(np.eye(4)))
    poses = {node.index: node.poses[-1] for node in everything}
    return [primitive for node in everything for primitive in file.primitives(node, poses)]


def parts(translation=(0, 0, 0), rotation=(0, 0, 0, 1), scale=(1, 1, 1)):
    return {"translation": list(translation), "rotation": list(rotation), "scale": list(scale)}


def random_parts():
    quaternion = RNG.normal(size=4)
    return parts(RNG.normal(size=3), quaternion / np.linalg.norm(quaternion), RNG.uniform(0.5, 2, 3))


# Nodes


def test_the_pose_of_a_node_is_that_of_its_parent_times_its_own():
    family = [{"name": name, **random_parts()} for name in "abc"]
    own = {name: by_name(Glb(nodes=[node]))[name].poses[-1] for name, node in zip("abc", family, strict=True)}
    family[0]["children"] = [1]
    family[1]["children"] = [2]
    T_model_file = se3.transform(se3.rotation_z(0.4), [1.0, 2.0, 3.0])
    found = by_name(Glb(nodes=family), T_model_file)
    np.testing.assert_allclose(found["c"].poses[-1], T_model_file @ own["a"] @ own["b"] @ own["c"])
    np.testing.assert_array_equal(found["c"].poses[0], T_model_file)
    assert len(found["c"].poses) == 4
    assert found["c"].names == ("a", "b", "c")


def test_a_matrix_is_by_columns_and_says_the_same_as_its_parts():
    whole = random_parts()
    T = by_name(Glb(nodes=[{"name": "a", **whole}]))["a"].poses[-1]
    same = by_name(Glb(nodes=[{"name": "a", "matrix": T.T.ravel().tolist()}]))["a"].poses[-1]
    np.testing.assert_allclose(same, T)


def test_a_scale_acts_before_the_rotation_and_the_rotation_before_the_translation():
    half = np.sqrt(0.5)
    quarter_about_z = [0, 0, half, half]
    node = {"name": "a", **parts([10, 20, 30], quarter_about_z, [2, 3, 4])}
    T = by_name(Glb(nodes=[node]))["a"].poses[-1]
    np.testing.assert_allclose(T @ [1, 0, 0, 1], [10, 22, 30, 1], atol=1e-12)
    np.testing.assert_allclose(T @ [0, 1, 0, 1], [7, 20, 30, 1], atol=1e-12)


def test_a_rotation_of_any_length_is_the_same_rotation():
    first, second = (
        by_name(Glb(nodes=[{"name": "a", "rotation": (factor * np.array([0.1, 0.7, 0.1, 0.7])).tolist()}]))["a"]
        for factor in (1.0, 3.0)
    )
    np.testing.assert_allclose(first.poses[-1], second.poses[-1], atol=1e-12)
    assert np.linalg.det(first.poses[-1]) == pytest.approx(1)


def test_parents_come_before_children_and_children_in_their_order():
    tree = [{"name": "root", "children": [2, 1]}, {"name": "b"}, {"name": "a", "children": [3]}, {"name": "c"}]
    assert [node.names[-1] for node in nodes(Glb(nodes=tree))] == ["root", "a", "c", "b"]


def test_only_the_nodes_of_the_default_scene_are_read():
    tree = [{"name": "a"}, {"name": "b"}, {"name": "c"}]
    scenes = [{"nodes": [0]}, {"nodes": [2, 1]}]
    assert list(by_name(Glb(nodes=tree))) == ["a", "b", "c"]
    assert list(by_name(Glb(nodes=tree, scenes=scenes))) == ["a"]
    assert list(by_name(Glb(nodes=tree, scenes=scenes, scene=1))) == ["c", "b"]


@pytest.mark.parametrize("children", [[0], [1], [1, 1]])
def test_a_node_that_is_below_itself_or_twice_in_the_tree_is_refused(children):
    tree = [{"name": "a", "children": children}, {"name": "b", "children": [1] if children == [1] else []}]
    with pytest.raises(ModelError, match="is in the tree twice or too deep"):
        nodes(Glb(nodes=tree, scenes=[{"nodes": [0]}]))


def test_a_tree_may_be_256_nodes_deep_and_no_deeper():
    def chain(depth):
        tree = [{"children": [n + 1]} for n in range(depth - 1)]
        return Glb(nodes=[*tree, {}])

    assert len(nodes(chain(256))) == 256
    with pytest.raises(ModelError, match="too deep"):
        nodes(chain(257))


def test_roles_are_read_from_extras_and_everything_has_a_name():
    tree = [{"extras": {"vobench": "mover"}}, {"extras": "text"}, {"name": "c", "extras": {"vobench": 3}}]
    assert [node.roles for node in nodes(Glb(nodes=tree))] == [("mover",), ("",), ("3",)]
    assert [str(node) for node in nodes(Glb(nodes=tree))] == ["node 'node_0'", "node 'node_1'", "node 'c'"]


def test_instances_stand_in_the_frame_of_their_node():
    glb = Glb()
    offsets = [[1, 0, 0], [0, 2, 0], [0, 0, 3]]
    attributes = {"TRANSLATION": glb.numbers(offsets)}
    extensions = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    glb.tree["nodes"] = [{"name": "a", "scale": [2, 2, 2], "translation": [5, 0, 0], "extensions": extensions}]
    origins = [node.poses[-1][:3, 3] for node in nodes(glb)]
    np.testing.assert_allclose(origins, 2 * np.array(offsets) + [5, 0, 0])


def test_too_many_instances_are_refused(monkeypatch):
    monkeypatch.setattr(gltf, "MOST_INSTANCES", 2)
    for count in (2, 3):
        glb = Glb()
        attributes = {"TRANSLATION": glb.numbers(np.zeros((count, 3)))}
        glb.tree["nodes"] = [{"extensions": {"EXT_mesh_gpu_instancing": {"attributes": attributes}}}]
        if count == 2:
            assert len(nodes(glb)) == 2
        else:
            with pytest.raises(ModelError, match="more than 2 instances"):
                nodes(glb)


# Faces


def faces_of(mode, count, indices=None):
    glb = Glb(nodes=[{"mesh": 0}])
    corners = np.column_stack([np.arange(count), np.arange(count) ** 2, np.zeros(count)])
    more = {} if indices is None else {"faces": indices}
    glb.tree["meshes"] = [{"primitives": [glb.primitive(corners, mode=mode, **more)]}]
    return primitives(glb)[0].mesh.faces


def test_a_list_has_a_face_for_every_three_corners_and_drops_the_rest():
    np.testing.assert_array_equal(faces_of(LIST, 7), [[0, 1, 2], [3, 4, 5]])
    np.testing.assert_array_equal(faces_of(LIST, 7, [6, 5, 4, 1, 2, 3]), [[6, 5, 4], [1, 2, 3]])


@pytest.mark.parametrize("mode", [STRIP, FAN])
@pytest.mark.parametrize("count", [3, 4, 5, 8])
def test_strips_and_fans_have_two_faces_less_than_corners_and_all_turn_one_way(mode, count):
    """Corners on a circle in order for a fan; from side to side for a strip."""
    angle = np.arange(count) * 2 * np.pi / count
    circle = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    zigzag = np.column_stack([np.arange(count), -(np.arange(count) % 2), np.zeros(count)])
    corners = circle if mode == FAN else zigzag * [1, -1, 1]
    glb = Glb(nodes=[{"mesh": 0}])
    glb.tree["meshes"] = [{"primitives": [glb.primitive(corners, mode=mode)]}]
    mesh = primitives(glb)[0].mesh
    a, b, c = mesh.corners_m.swapaxes(0, 1)
    normals_z = np.cross(b - a, c - a)[:, 2]
    assert len(mesh.faces) == count - 2
    assert len(set(np.sign(normals_z))) == 1
    assert mesh.faces[0].tolist() in ([0, 1, 2], [1, 2, 0])
    if mode == FAN:
        assert np.abs(normals_z).sum() / 2 == pytest.approx(count / 2 * np.sin(2 * np.pi / count))


@pytest.mark.parametrize("mode", [0, 1, 2, 3])
def test_points_and_lines_have_no_faces_and_are_noted(mode):
    glb = Glb(nodes=[{"name": "a", "mesh": 0}])
    glb.tree["meshes"] = [{"primitives": [glb.primitive(mode=mode)]}]
    (primitive,) = primitives(glb)
    assert primitive.mesh.faces.shape == (0, 3)
    assert primitive.notes == ("node 'a': points and lines left out",)


def test_a_face_with_a_corner_that_does_not_exist_is_refused():
    assert faces_of(LIST, 3, [0, 1, 2]).max() == 2
    with pytest.raises(ModelError, match="a face has vertex 3 of 3"):
        faces_of(LIST, 3, [0, 1, 3])


def test_vertices_normals_and_coordinates_are_those_of_the_file_and_missing_ones_are_zero():
    glb = Glb(nodes=[{"mesh": 0}], materials=[{}])
    normals = [[0, 0, 1], [0, 1, 0], [1, 0, 0]]
    uv = [[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]]
    full = glb.primitive(NORMAL=glb.numbers(normals), TEXCOORD_0=glb.numbers(uv), material=0)
    glb.tree["meshes"] = [{"primitives": [full, glb.primitive()]}]
    first, bare = primitives(glb)
    np.testing.assert_allclose(first.mesh.vertices_m, CORNERS)
    np.testing.assert_allclose(first.mesh.normals, normals)
    np.testing.assert_allclose(first.mesh.uv, uv, atol=1e-7)
    np.testing.assert_array_equal(bare.mesh.normals, np.zeros((3, 3)))
    np.testing.assert_array_equal(bare.mesh.uv, np.zeros((3, 2)))
    assert bare.look is BARE
    assert first.look is not BARE


def test_colours_are_linear_or_srgb_and_within_what_can_be_reflected():
    glb = Glb(nodes=[{"mesh": 0}])
    rgba = [[0.2, 0.5, 1.5, 1], [0, 0, 0, 0], [1, 1, 1, 0.5]]
    glb.tree["meshes"] = [{"primitives": [glb.primitive(COLOR_0=glb.numbers(rgba))]}]
    (plain,) = primitives(glb)
    clipped = np.clip(np.array(rgba)[:, :3], 0, 1)
    np.testing.assert_allclose(plain.colours, clipped, atol=1e-7)
    assert plain.look is not BARE
    (as_srgb,) = primitives(glb, has_srgb_vertices=True)
    np.testing.assert_allclose(as_srgb.colours, linear(clipped), atol=1e-6)


def skinned(weights, *, joint_parts, inverse_bind=True):
    glb = Glb()
    count = len(joint_parts)
    joints = [[0, 1, 0, 0]] * 3
    attributes = {
        "JOINTS_0": glb.numbers(joints, "uint8"),
        "WEIGHTS_0": glb.numbers(weights),
        "NORMAL": glb.numbers([[0, 0, 1]] * 3),
    }
    glb.tree["meshes"] = [{"primitives": [glb.primitive(**attributes)]}]
    skin = {"joints": list(range(1, count + 1))}
    if inverse_bind:
        skin["inverseBindMatrices"] = glb.numbers([np.eye(4).ravel()] * count)
    glb.tree["skins"] = [skin]
    mesh_node = {"name": "body", "mesh": 0, "skin": 0, "translation": [100, 0, 0]}
    glb.tree["nodes"] = [mesh_node, *({"name": f"joint{n}", **part} for n, part in enumerate(joint_parts))]
    (primitive,) = primitives(glb)
    return primitive


@pytest.mark.parametrize("inverse_bind", [True, False])
def test_a_vertex_of_a_skin_is_moved_by_its_joints_in_proportion_to_their_weights(inverse_bind):
    joint_parts = [parts([1, 0, 0]), parts([0, 10, 0])]
    weights = [[1, 0, 0, 0], [0, 1, 0, 0], [1, 3, 0, 0]]  # the last are normalized
    primitive = skinned(weights, joint_parts=joint_parts, inverse_bind=inverse_bind)
    offsets = np.array([[1, 0, 0], [0, 10, 0], [0.25, 7.5, 0]])
    expected = np.array(CORNERS) + offsets
    np.testing.assert_allclose(primitive.mesh.vertices_m, expected, atol=1e-6)
    np.testing.assert_array_equal(primitive.T_model_mesh, np.eye(4))  # the pose of the node does not count
    assert primitive.notes == ("node 'body': skin read in the pose of the file",)


def test_normals_of_a_skin_are_rotated_by_its_joints_and_stay_units():
    half = np.sqrt(0.5)
    quarter_about_x = parts(rotation=[half, 0, 0, half], scale=[2, 2, 2])
    primitive = skinned([[1, 0, 0, 0]] * 3, joint_parts=[quarter_about_x, parts()])
    np.testing.assert_allclose(primitive.mesh.normals, [[0, -1, 0]] * 3, atol=1e-6)


def test_faces_are_counted_before_they_are_read(monkeypatch):
    glb = triangle(nodes=[{}, {}, {}])
    for most, is_refused in ((3, False), (2, True)):
        monkeypatch.setattr(gltf, "MOST_FACES", most)
        file = read(glb)
        everything = list(file.nodes(np.eye(4)))
        if is_refused:
            with pytest.raises(ModelError, match="has 3 faces, more than 2"):
                file.require_few_faces(everything)
        else:
            file.require_few_faces(everything)


@pytest.mark.parametrize(("mode", "corners"), [(LIST, 9), (STRIP, 5), (FAN, 5)])
def test_the_count_of_faces_is_never_too_small(monkeypatch, mode, corners):
    glb = Glb(nodes=[{"mesh": 0}])
    glb.tree["meshes"] = [{"primitives": [glb.primitive(RNG.normal(size=(corners, 3)), mode=mode)]}]
    faces = len(primitives(glb)[0].mesh.faces)
    assert faces == 3
    monkeypatch.setattr(gltf, "MOST_FACES", faces - 1)
    file = read(glb)
    with pytest.raises(ModelError, match="more than 2"):
        file.require_few_faces(list(file.nodes(np.eye(4))))


# Lights


def lit(source, **node):
    glb = Glb(nodes=[{"name": "lamp", "extensions": {"KHR_lights_punctual": {"light": 0}}, **node}])
    glb.tree["extensions"] = {"KHR_lights_punctual": {"lights": [source]}}
    file = read(glb)
    (node_with_light,) = file.nodes(np.eye(4))
    (light,) = file.lights(node_with_light)
    return light


def test_a_point_light_radiates_its_candela_into_the_whole_sphere():
    light = lit({"type": "point", "intensity": 3.0, "color": [1, 0.5, -1]}, translation=[1, 2, 3])
    assert isinstance(light, PointLight)
    assert light.power_lm == pytest.approx(4 * np.pi * 3)
    np.testing.assert_array_equal(light.position_m, [1, 2, 3])
    assert light.colour == (1, 0.5, 0)
    assert light.name == "lamp"


@pytest.mark.parametrize("cone_deg", [(0, 45), (20, 30), (0, 90)])
def test_a_spot_light_has_its_candela_on_its_axis_whatever_its_cone(cone_deg):
    inner_rad, outer_rad = np.deg2rad(cone_deg)
    cones = {"innerConeAngle": inner_rad, "outerConeAngle": outer_rad}
    light = lit({"type": "spot", "intensity": 50.0, "spot": cones})
    assert isinstance(light, SpotLight)
    assert light.peak_cd == pytest.approx(50)
    np.testing.assert_allclose(light.direction, [0, 0, -1])


def test_a_light_shines_along_the_minus_z_axis_of_its_node_whatever_its_scale():
    half = np.sqrt(0.5)
    light = lit({"type": "spot"}, rotation=[0, half, 0, half], scale=[3, 3, 3])  # 90° about y: z becomes x
    np.testing.assert_allclose(light.direction, [-1, 0, 0], atol=1e-12)


@pytest.mark.parametrize(
    ("backwards", "azimuth_deg", "elevation_deg"),
    [([0, 0, 1], None, 90), ([1, 0, 0], 0, 0), ([0, 1, 0], 90, 0), ([1, 0, 1], 0, 45), ([0, -1, 1], -90, 45)],
)
def test_a_directional_light_is_a_sun_behind_which_its_node_looks(backwards, azimuth_deg, elevation_deg):
    z_axis = np.array(backwards) / np.linalg.norm(backwards)
    x_axis = np.cross([0.3, 0.5, 0.8], z_axis)
    x_axis /= np.linalg.norm(x_axis)
    T = np.eye(4)
    T[:3, :3] = np.column_stack([x_axis, np.cross(z_axis, x_axis), z_axis])
    light = lit({"type": "directional", "intensity": 1000.0}, matrix=T.T.ravel().tolist())
    assert isinstance(light, Sun)
    assert light.elevation_deg[0] == pytest.approx(elevation_deg, abs=1e-4)
    if azimuth_deg is not None:
        assert light.azimuth_deg[0] == pytest.approx(azimuth_deg, abs=1e-4)


def test_a_negative_intensity_is_none_and_an_unknown_kind_is_refused():
    assert lit({"type": "point", "intensity": -5}).power_lm == 0
    with pytest.raises(ModelError, match="has a light of type 'area', which glTF does not know"):
        lit({"type": "area"})


def test_a_node_without_a_light_has_none():
    file = read(Glb(nodes=[{}]))
    (node,) = file.nodes(np.eye(4))
    assert file.lights(node) == []
