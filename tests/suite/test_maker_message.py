"""What a maker hands back arrives as it was sent, and what a stranger may have written is refused in one line."""

import json
import struct

import numpy as np
import pytest

from vobench.asset.texture import Procedural
from vobench.errors import SuiteError
from vobench.scene.light import AreaLight, Dimmer, Flicker, PointLight, Scaled, Sky, SpotLight, Steady, Sun, Switched
from vobench.scene.material import Material, Picture
from vobench.scene.mesh import make_mesh, quad
from vobench.scene.triangles import Thing
from vobench.suite.maker_message import LENGTH, GeneratedPlace, checked, decode, encode

WALL = quad((0, 0, 0), (1, 0, 0), (0, 1, 0))
LEVELS = (
    Steady(0.5),
    Flicker(0.1),
    Dimmer((0.0, 1.0), (0.0, 1.0)),
    Switched((1.0,)),
    Scaled(Flicker(0.2), 3.0),
)


def _scene() -> GeneratedPlace:
    picture = Picture(np.arange(48, dtype=np.uint8).reshape(4, 4, 3), tile_m=2.0)
    materials = {
        "chalk": Material(colour=(0.1, 0.2, 0.3), texture=picture),
        "slate": Material(texture=picture, emission_cd_m2=(1.0, 2.0, 3.0), cutout=0.5),
        "oak": Material(texture=Procedural("wood", 0.4, contrast=0.3, resolution_px=16, seed=3), eta=1.5),
        "glass": Material(kind="pane", eta=1.5),
    }
    things = (Thing("wall", WALL, "chalk"), Thing("floor", WALL, "oak", spacing_m=0.1))
    up = np.array([0.0, 0.0, 1.0])
    lights = (
        AreaLight("panel", WALL, 100.0, LEVELS[0]),
        PointLight("bulb", up, 10.0, LEVELS[1], (1.0, 0.5, 0.2)),
        SpotLight("spot", up, -up, 10.0, 10.0, 20.0, LEVELS[2]),
        Sun("sun", 1e4, (0.0,), (10.0,), (20.0,), LEVELS[3]),
        Sky("sky", 5e3, "clear", up, level=LEVELS[4]),
    )
    return GeneratedPlace(things, materials, lights)


def test_all_that_a_maker_may_return_arrives_with_the_same_bytes() -> None:
    sent = _scene()
    arrived = decode(encode(sent))
    assert encode(arrived) == encode(sent)
    assert [type(light) for light in arrived.lights] == [type(light) for light in sent.lights]
    assert [light.level for light in arrived.lights] == list(LEVELS)
    np.testing.assert_array_equal(arrived.things[0].mesh.vertices, WALL.vertices)
    np.testing.assert_array_equal(arrived.things[0].mesh.faces, WALL.faces)
    assert arrived.materials["oak"] == sent.materials["oak"]


def test_what_is_used_twice_is_sent_once_and_stays_one_object() -> None:
    arrived = decode(encode(_scene()))
    assert arrived.materials["chalk"].texture is arrived.materials["slate"].texture
    assert arrived.things[0].mesh is arrived.things[1].mesh


def test_a_texture_of_the_makers_own_class_arrives_as_its_picture() -> None:
    class Stripes:
        tile_m = 0.5

        def pixels(self):
            return np.eye(3, dtype=np.float32)

    arrived = decode(encode(GeneratedPlace((), {"striped": Material(texture=Stripes())})))
    texture = arrived.materials["striped"].texture
    assert isinstance(texture, Picture)
    assert texture.tile_m == 0.5
    np.testing.assert_array_equal(texture.pixels(), np.eye(3))


@pytest.mark.parametrize(
    ("returned", "sentence"),
    [
        (None, "should return things, materials by name and, optionally, lights"),
        ((1, 2, 3, 4), "should return things, materials by name and, optionally, lights"),
        ((3, {}), "a list of things, not int"),
        ((["wall"], {}), "a thing that is no Thing: str"),
        (([], []), "materials by name, not list"),
        (([], {"chalk": "white"}), "a material that is no Material: str"),
        (([], {}, ["lamp"]), "a light that is no AreaLight or PointLight"),
        (([Thing("wall", WALL, "chalk")], {}), "things without materials: chalk"),
        (([Thing("wall", 3, "chalk")], {"chalk": Material()}), "'wall' with a mesh of type int"),
    ],
)
def test_what_make_should_not_return_is_named(returned, sentence) -> None:
    with pytest.raises(SuiteError, match=sentence):
        checked(returned)


def test_things_and_lights_may_come_from_generators() -> None:
    sent = _scene()
    made = checked(((thing for thing in sent.things), sent.materials, (light for light in sent.lights)))
    assert made.things == sent.things
    assert made.lights == sent.lights


class TestHostile:
    """Each changes one thing in a message that is right."""

    @staticmethod
    def _changed(change) -> bytes:
        content = encode(_scene())
        (length,) = LENGTH.unpack_from(content)
        header = json.loads(content[8 : 8 + length])
        change(header)
        text = json.dumps(header).encode()
        return LENGTH.pack(len(text)) + text + content[8 + length :]

    @staticmethod
    def _first(header, name):
        return next(entry["fields"] for entry in header["objects"] if entry["class"] == name)

    @staticmethod
    def _first_array(header):
        return TestHostile._first(header, "MeshArrays")["vertices_m"]["array"]

    def test_the_unchanged_one_is_read(self) -> None:
        assert len(decode(self._changed(lambda header: None)).things) == 2

    @pytest.mark.parametrize(
        "change",
        [
            lambda header: TestHostile._first_array(header).update(offset=float("inf")),
            lambda header: TestHostile._first_array(header).update(shape=[2**40, 2**40]),
            lambda header: header["objects"][0].update({"class": "Path"}),
            lambda header: header["objects"][0].update({"class": "__import__"}),
            lambda header: header["objects"][0]["fields"].update({"__class__": 1}),
            lambda header: header["objects"][0].pop("fields"),
            lambda header: header.pop("things"),
            lambda header: header.update(things=[10**9]),
            lambda header: header.update(things=["0"]),
            lambda header: header.update(objects=7),
            lambda header: header.update(materials=[]),
        ],
    )
    def test_another_structure_is_refused(self, change) -> None:
        with pytest.raises(SuiteError):
            decode(self._changed(change))

    @pytest.mark.parametrize(
        "array",
        [
            {"dtype": "object", "shape": [4, 3], "offset": 0},
            {"dtype": "float64", "shape": [10**12, 3], "offset": 0},
            {"dtype": "float64", "shape": [-1, 3], "offset": 0},
            {"dtype": "float64", "shape": [4, 3], "offset": -96},
            {"dtype": "float64", "shape": [4, 3], "offset": 10**15},
            {"dtype": "float64", "shape": [3, 4], "offset": 0},
            {"dtype": "float64", "shape": [4, 3]},
        ],
    )
    def test_an_array_that_is_not_there_is_refused(self, array) -> None:
        def change(header):
            self._first(header, "MeshArrays")["vertices_m"] = {"array": array}

        with pytest.raises(SuiteError):
            decode(self._changed(change))

    def test_a_negative_length_does_not_mean_all_the_rest(self) -> None:
        def change(header):
            self._first(header, "Picture")["values"]["array"].update(shape=[-1, 1], offset=0)

        with pytest.raises(SuiteError, match=r"an array of uint8, shape \[-1, 1\]"):
            decode(self._changed(change))

    def test_faces_of_vertices_that_are_not_there_are_refused(self) -> None:
        mesh = make_mesh(WALL.vertices, [[0, 1, 99]], np.zeros((4, 2)), WALL.vertex_normals)
        with pytest.raises(SuiteError, match="'wall' with a mesh whose faces name a vertex that is not there"):
            checked(([Thing("wall", mesh, "chalk")], {"chalk": Material()}))

    def test_numbers_that_are_not_finite_are_refused(self) -> None:
        mesh = quad((0, 0, np.nan), (1, 0, 0), (0, 1, 0))
        with pytest.raises(SuiteError, match="'wall' with a mesh whose vertices have a number that is not finite"):
            checked(([Thing("wall", mesh, "chalk")], {"chalk": Material()}))

    def test_the_same_is_refused_in_a_message(self) -> None:
        def change(header):
            fields = self._first(header, "MeshArrays")
            bits_of_floats = {"dtype": "int64", "shape": [1, 3], "offset": fields["vertices_m"]["array"]["offset"] + 24}
            fields["faces"] = {"array": bits_of_floats}

        with pytest.raises(SuiteError, match="faces name a vertex that is not there"):
            decode(self._changed(change))

    @pytest.mark.parametrize(
        ("fields", "place"), [({"colour": "red"}, "colour"), ({"kind": "portal"}, "kind"), ({"eta": None}, "eta")]
    )
    def test_a_field_of_another_type_is_named(self, fields, place) -> None:
        with pytest.raises(SuiteError, match=f"returns a Material with a wrong {place}"):
            decode(self._changed(lambda header: self._first(header, "Material").update(fields)))

    @pytest.mark.parametrize("content", [b"", b"12345678", struct.pack("<Q", 10**18), LENGTH.pack(4) + b"[[[["])
    def test_bytes_that_are_no_message_are_refused(self, content) -> None:
        with pytest.raises(SuiteError, match="cannot be read"):
            decode(content)

    def test_a_nested_header_is_refused(self) -> None:
        text = b"[" * 200_000
        with pytest.raises(SuiteError, match="cannot be read"):
            decode(LENGTH.pack(len(text)) + text)
