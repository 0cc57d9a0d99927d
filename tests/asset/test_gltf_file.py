"""The container of glTF: numbers are read as they were written, and nothing is read beyond the end."""

import base64
import json
import struct
from itertools import pairwise

import numpy as np
import pytest

from tests.asset.glb import Glb
from vobench.asset import gltf_file
from vobench.asset.gltf_file import COMPONENTS, EXTENSIONS, located, numbers, read_gltf_file
from vobench.errors import ModelError

KINDS = ["int8", "uint8", "int16", "uint16", "uint32", "float32"]
WIDTHS = [1, 2, 3, 4, 16]


def read(glb, folder=None):
    return read_gltf_file(glb if isinstance(glb, bytes) else glb.bytes(), folder)


def table(kind, rows=5, width=3):
    values = np.arange(rows * width).reshape(rows, width) * 7
    return values % 100 - (50 if kind.startswith(("i", "f")) else 0)


# Accessors


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("width", WIDTHS)
def test_an_accessor_has_the_numbers_and_the_type_that_were_written(kind, width):
    glb = Glb()
    glb.numbers([[0.5]])  # so that it does not begin at 0
    values = table(kind, width=width)
    index = glb.numbers(values, kind)
    array = read(glb).accessor(index)
    np.testing.assert_array_equal(array, values.reshape(-1, width))
    assert array.dtype == np.dtype(kind)


@pytest.mark.parametrize(("kind", "smallest"), [("int8", -1), ("int16", -1), ("uint8", 0), ("uint16", 0)])
def test_normalized_integers_run_from_their_smallest_to_one(kind, smallest):
    limits = np.iinfo(kind)
    glb = Glb()
    index = glb.numbers([[limits.min], [0], [limits.max]], kind, normalized=True)
    np.testing.assert_allclose(read(glb).accessor(index)[:, 0], [smallest, 0, 1], atol=1e-12)


def test_normalized_floats_stay_as_they_are():
    glb = Glb()
    index = glb.numbers([[2.5], [-3.0]], normalized=True)
    np.testing.assert_array_equal(read(glb).accessor(index)[:, 0], [2.5, -3.0])


def test_interleaved_arrays_are_taken_apart_by_their_stride():
    rows = np.zeros(4, [("position", "<f4", 3), ("normal", "<f4", 3)])
    rows["position"] = table("float32", rows=4)
    rows["normal"] = -rows["position"]
    glb = Glb()
    view = glb.view(rows.tobytes(), byteStride=24)
    for offset in (0, 12):
        glb.tree["accessors"].append(
            {"bufferView": view, "byteOffset": offset, "componentType": 5126, "count": 4, "type": "VEC3"}
        )
    file = read(glb)
    np.testing.assert_array_equal(file.accessor(0), rows["position"])
    np.testing.assert_array_equal(file.accessor(1), rows["normal"])


@pytest.mark.parametrize("has_base", [True, False])
def test_sparse_rows_replace_those_of_the_base_or_zeros(has_base):
    glb = Glb()
    base = table("float32", rows=6)
    index = glb.numbers(base)
    accessor = glb.tree["accessors"][index]
    if not has_base:
        del accessor["bufferView"]
    rows = glb.view(np.array([1, 4], "<u2").tobytes())
    values = glb.view(np.array([[9, 8, 7], [6, 5, 4]], "<f4").tobytes())
    accessor["sparse"] = {
        "count": 2,
        "indices": {"bufferView": rows, "componentType": 5123},
        "values": {"bufferView": values},
    }
    expected = base.astype(float) if has_base else np.zeros((6, 3))
    expected[[1, 4]] = [[9, 8, 7], [6, 5, 4]]
    np.testing.assert_array_equal(read(glb).accessor(index), expected)


def test_the_base_of_a_sparse_accessor_is_not_changed():
    glb = Glb()
    index = glb.numbers([[1.0], [2.0]])
    glb.tree["accessors"].append(dict(glb.tree["accessors"][index]))
    rows = glb.view(np.array([0], "u1").tobytes())
    values = glb.view(np.array([9], "<f4").tobytes())
    glb.tree["accessors"][index]["sparse"] = {
        "count": 1,
        "indices": {"bufferView": rows, "componentType": 5121},
        "values": {"bufferView": values},
    }
    file = read(glb)
    assert file.accessor(index)[:, 0].tolist() == [9, 2]
    assert file.accessor(index + 1)[:, 0].tolist() == [1, 2]


def test_an_accessor_that_ends_with_its_buffer_is_read_and_one_byte_less_is_refused():
    glb = Glb()
    index = glb.numbers(table("float32"))
    assert read(glb).accessor(index).shape == (5, 3)
    glb.tree["bufferViews"][-1]["byteLength"] -= 1
    with pytest.raises(ModelError, match="byte 60 of 59 is requested"):
        read(glb).accessor(index)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"byteOffset": -4}, "is requested"),
        ({"count": 6}, "byte 72 of 60 is requested"),
        ({"count": -1}, "has -1 rows"),
        ({"count": 2.0}, "has 2.0 rows"),
        ({"count": 3_000_001}, "has 3,000,001 rows, and should have 3,000,000"),
    ],
)
def test_an_impossible_accessor_is_refused(change, message):
    glb = Glb()
    index = glb.numbers(table("float32"), **change)
    with pytest.raises(ModelError, match=message):
        read(glb).accessor(index)


def test_a_stride_shorter_than_a_row_is_refused():
    glb = Glb()
    index = glb.numbers(table("float32"))
    glb.tree["bufferViews"][-1]["byteStride"] = 8
    with pytest.raises(ModelError, match="is requested"):
        read(glb).accessor(index)


def test_another_number_of_rows_than_expected_is_refused():
    glb = Glb()
    index = glb.numbers(table("float32"))
    file = read(glb)
    assert len(file.accessor(index, 5)) == 5
    with pytest.raises(ModelError, match="has 5 rows, and should have 4"):
        file.accessor(index, 4)


def test_an_accessor_without_data_names_the_tool_that_decompresses_it():
    glb = Glb()
    index = glb.numbers(table("float32"))
    del glb.tree["accessors"][index]["bufferView"]
    with pytest.raises(ModelError, match="has no data; if it is compressed, decompress it: gltf-transform"):
        read(glb).accessor(index)


@pytest.mark.parametrize("index", [-1, 1, True, 0.0, "0", None])
def test_only_numbers_of_entries_that_exist_are_indices(index):
    glb = Glb(nodes=[{"name": "only"}])
    file = read(glb)
    assert file.entry("nodes", 0) == {"name": "only"}
    with pytest.raises(ModelError, match="of 1 nodes is requested"):
        file.entry("nodes", index)


# Buffers


@pytest.mark.parametrize("length", range(9))
def test_a_glb_has_its_text_and_its_bytes_whatever_their_padding(length):
    glb = Glb(extras="x" * length)
    view = glb.view(bytes(range(length)))
    file = read(glb)
    assert file.tree["extras"] == "x" * length
    assert bytes(file.view(view)) == bytes(range(length))


def test_a_glb_without_bytes_is_read():
    text = json.dumps({"asset": {"version": "2.0"}}).encode()
    data = b"glTF" + struct.pack("<III4s", 2, 20 + len(text), len(text), b"JSON") + text
    file = read(data)
    assert file.buffers == ()


@pytest.mark.parametrize("share", [0.0, 0.3, 0.6, 0.99])
def test_a_torn_glb_is_refused(share):
    glb = Glb()
    glb.numbers(table("float32", rows=100))
    data = glb.bytes()
    torn = data[: 24 + int(share * (len(data) - 24))]
    with pytest.raises(ModelError, match="or they are damaged; copy or export it again"):
        read(torn)


@pytest.mark.parametrize("version", [1, 3])
def test_another_version_of_the_container_or_of_the_content_is_refused(version):
    data = Glb().bytes()
    with pytest.raises(ModelError, match=f"is glTF {version}, not 2"):
        read(data[:4] + struct.pack("<I", version) + data[8:])
    with pytest.raises(ModelError, match=rf"is glTF {version}\.0, not 2"):
        read(Glb(asset={"version": f"{version}.0"}))


@pytest.mark.parametrize("beginning", [b"", b"\xef\xbb\xbf", b" \r\n\t"])
def test_json_may_begin_with_a_byte_order_mark_or_blanks(beginning):
    assert read(beginning + b'{"asset": {"version": "2.1"}}').tree["asset"]["version"] == "2.1"


@pytest.mark.parametrize("data", [b"", b"solid cube", b"[1, 2]", b"\x89PNG"])
def test_files_of_other_formats_are_refused(data):
    with pytest.raises(ModelError, match="begins like neither"):
        read(data)


def with_buffer(uri):
    return json.dumps({"asset": {"version": "2.0"}, "buffers": [{"uri": uri}]}).encode()


def test_a_buffer_is_in_the_text_or_beside_the_file(tmp_path):
    content = bytes(range(256))
    (tmp_path / "a b.bin").write_bytes(content)
    encoded = base64.b64encode(content).decode()
    for uri in ("a b.bin", "a%20b.bin", f"data:application/octet-stream;base64,{encoded}"):
        assert bytes(read(with_buffer(uri), tmp_path).buffers[0]) == content


def test_a_buffer_that_is_missing_or_named_by_its_absolute_path_is_refused(tmp_path):
    (tmp_path / "there.bin").write_bytes(b"x")
    for uri in ("gone.bin", str(tmp_path / "there.bin"), "."):
        with pytest.raises(ModelError, match="which is not beside it"):
            read(with_buffer(uri), tmp_path)


def test_a_buffer_larger_than_a_gigabyte_is_refused_before_it_is_read(tmp_path, monkeypatch):
    monkeypatch.setattr(gltf_file, "MOST_BYTES", 10)
    for size in (10, 11):
        (tmp_path / f"{size}.bin").write_bytes(bytes(size))
    assert len(read(with_buffer("10.bin"), tmp_path).buffers[0]) == 10
    with pytest.raises(ModelError, match=r"needs '11\.bin'"):
        read(with_buffer("11.bin"), tmp_path)


@pytest.mark.parametrize(("start", "length"), [(-1, 4), (0, 101), (99, 2), (50, -1)])
def test_a_view_beyond_its_buffer_is_refused(start, length):
    glb = Glb()
    whole = glb.view(bytes(100))
    glb.tree["bufferViews"].append({"buffer": 0, "byteOffset": start, "byteLength": length})
    file = read(glb)
    assert len(file.view(whole)) == 100
    with pytest.raises(ModelError, match="is requested; copy or export it again"):
        file.view(whole + 1)


# Extensions and errors


@pytest.mark.parametrize("name", EXTENSIONS)
def test_a_required_extension_is_read_or_refused_and_an_optional_one_is_read_or_noted(name):
    is_read = not EXTENSIONS[name]
    assert (read(Glb(extensionsUsed=[name])).notes == ()) == is_read
    if is_read:
        read(Glb(extensionsRequired=[name]))
    else:
        with pytest.raises(ModelError):
            read(Glb(extensionsRequired=[name]))


def test_an_unknown_extension_is_refused_if_required_and_noted_if_not():
    with pytest.raises(ModelError, match="needs the extension ACME_fur, which is unknown here"):
        read(Glb(extensionsRequired=["ACME_fur"]))
    file = read(Glb(extensionsUsed=["ACME_wool", "ACME_fur"], animations=[{}]))
    assert file.notes == ("ACME_fur is not read", "ACME_wool is not read", "animations are not played")


def test_numbers_have_a_shape_and_are_finite():
    np.testing.assert_array_equal(numbers([1, 2, 3], 3), [1.0, 2.0, 3.0])
    assert numbers(2.5) == 2.5
    for values, shape in (([1, 2], (3,)), ([1, float("nan"), 2], (3,)), ([1], ()), (float("inf"), ())):
        with pytest.raises(ModelError, match=f"expected {shape[0] if shape else 1} finite numbers"):
            numbers(values, *shape)


@pytest.mark.parametrize("error", [KeyError("mesh"), TypeError("a\n b"), ZeroDivisionError(), struct.error("short")])
def test_malformed_data_become_one_line_with_their_place(error):
    with pytest.raises(ModelError, match=r"^node 'a': does not conform to glTF 2.0") as raised, located("node 'a'"):
        raise error
    assert "\n" not in str(raised.value)


def test_errors_get_all_their_places_and_other_exceptions_stay():
    places = located("node 'a'"), located("material 'b'")
    with pytest.raises(ModelError, match=r"^node 'a': material 'b': is torn$"), places[0], places[1]:
        raise ModelError("is\ntorn")
    with pytest.raises(KeyboardInterrupt), located("node 'a'"):
        raise KeyboardInterrupt


def test_component_types_are_the_numbers_of_opengl_in_little_endian():
    sizes = [np.dtype(COMPONENTS[number]).itemsize for number in sorted(COMPONENTS)]
    assert sizes == [1, 1, 2, 2, 4, 4]
    for signed, unsigned in pairwise(sorted(COMPONENTS)[:4]):
        assert np.dtype(COMPONENTS[signed]) != np.dtype(COMPONENTS[unsigned])
    assert all(np.dtype(name).newbyteorder("<") == np.dtype(name) for name in COMPONENTS.values())
