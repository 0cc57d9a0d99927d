"""Reads the JSON, the buffers and the arrays of .glb and .gltf files. Source: Khronos, glTF 2.0."""

import base64
import json
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from vobench.errors import ModelError
from vobench.geometry.se3 import Array

Json = dict[str, Any]
# Larger files are refused before memory is allocated. Computing the light of more faces would take too long.
MOST_FACES = 1_000_000
MOST_BYTES = 1 << 30
GLB_HEADER_BYTES = 20  # the headers of the file and of its first chunk
CHUNK_HEADER_BYTES = 8

COMPONENTS = {5120: "i1", 5121: "u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
DECOMPRESS = "decompress it: gltf-transform cp in.glb out.glb"
# The known extensions: the reason why an extension is not read; empty for one that is read.
EXTENSIONS = {
    "KHR_draco_mesh_compression": f"is compressed by Draco; {DECOMPRESS}",
    "EXT_meshopt_compression": f"is compressed by meshopt; {DECOMPRESS}",
    "KHR_texture_basisu": "has KTX2 images; make them PNG: gltf-transform ktxdecompress in.glb out.glb",
    "KHR_materials_pbrSpecularGlossiness": "has materials of an old kind; gltf-transform metalrough in.glb out.glb",
    "KHR_lights_punctual": "",
    "KHR_mesh_quantization": "",
    "KHR_texture_transform": "",
    "KHR_materials_emissive_strength": "",
    "KHR_materials_ior": "",
    "KHR_materials_transmission": "",
    "KHR_materials_unlit": "",
    "EXT_mesh_gpu_instancing": "",
    "EXT_texture_webp": "",
}
MALFORMED = (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError, struct.error)


@contextmanager
def located(where: str) -> Iterator[None]:
    """Prefix errors with the place where they occurred. Other exceptions, from malformed data, become ModelErrors."""
    try:
        yield
    except ModelError as error:
        raise ModelError(_one_line(f"{where}: {error}")) from None
    except MALFORMED as error:
        cause = _one_line(f"{type(error).__name__}: {error}")
        raise ModelError(f"{where}: does not conform to glTF 2.0; export it again ({cause})") from error


def _one_line(text: str) -> str:
    return " ".join(text.split())


def numbers(values: Any, *shape: int) -> Array:
    """The values as an array of finite numbers with the given shape. Raises ModelError for other values."""
    array = np.asarray(values, float)
    if array.shape != shape or not np.isfinite(array).all():
        count = shape[0] if shape else 1
        raise ModelError(f"expected {count} finite numbers, found {str(values)[:60]}")
    return array


@dataclass(frozen=True, slots=True, eq=False)
class GltfFile:
    """A glTF file: its folder, JSON and buffers, and notes on what is not read."""

    folder: Path
    tree: Json
    buffers: tuple[memoryview, ...]
    notes: tuple[str, ...]

    def entry(self, kind: str, index: Any) -> Json:
        """The JSON object with an index in the list of a kind, such as "nodes"."""
        entries = self.tree.get(kind, [])
        if type(index) is not int or not 0 <= index < len(entries):
            raise ModelError(f"number {index} of {len(entries)} {kind} is requested; export it again")
        return dict(entries[index])

    def rows(self, index: Any) -> int:
        """The number of rows of an accessor."""
        count = self.entry("accessors", index)["count"]
        if type(count) is not int or count < 0:
            raise ModelError(f"accessor {index} has {count} rows; export it again")
        return count

    def accessor(
        self,
        index: Any,
        rows: int | None = None,
    ) -> NDArray[Any]:
        """The numbers (rows, width) of an accessor; floats if it is normalized.

        Raises ModelError unless it has the expected number of rows.
        """
        count = self.rows(index)
        accessor = self.entry("accessors", index)
        if count > 3 * MOST_FACES or rows not in (None, count):
            raise ModelError(f"accessor {index} has {count:,} rows, and should have {rows or 3 * MOST_FACES:,}")
        if "bufferView" not in accessor and "sparse" not in accessor:
            raise ModelError(f"accessor {index} has no data; if it is compressed, {DECOMPRESS}")

        dtype = np.dtype(COMPONENTS[accessor["componentType"]])
        width = WIDTHS[accessor["type"]]
        values = np.zeros((count, width), dtype)
        if "bufferView" in accessor:
            values = self._array(accessor, count, dtype, width)
        if sparse := accessor.get("sparse"):
            values = self._substituted(values, sparse)
        if accessor.get("normalized") and dtype.kind != "f":
            return np.asarray(np.maximum(values / np.iinfo(dtype).max, -1.0))
        return values

    def _substituted(self, values: NDArray[Any], sparse: Json) -> NDArray[Any]:
        """The values (N, width), in which the rows of a sparse accessor are replaced."""
        count, width = values.shape
        index_dtype = np.dtype(COMPONENTS[sparse["indices"]["componentType"]])
        indices = self._array(sparse["indices"], min(sparse["count"], count), index_dtype, 1)[:, 0]
        substituted = values.copy()
        substituted[indices] = self._array(sparse["values"], len(indices), values.dtype, width)
        return substituted

    def _array(
        self,
        source: Json,
        count: int,
        dtype: np.dtype[Any],
        width: int,
    ) -> NDArray[Any]:
        """The numbers (count, width) at an offset of a buffer view."""
        data = self.view(source["bufferView"])
        offset = source.get("byteOffset", 0)
        row_bytes = dtype.itemsize * width
        view = self.entry("bufferViews", source["bufferView"])
        stride = view.get("byteStride") or row_bytes
        end = offset + (count - 1) * stride + row_bytes
        if offset < 0 or stride < row_bytes or end > len(data):
            raise ModelError(_beyond(end, len(data)))
        return np.ndarray((count, width), dtype, data, offset, (stride, dtype.itemsize))

    def view(self, index: Any) -> memoryview:
        """The bytes of a buffer view."""
        view = self.entry("bufferViews", index)
        self.entry("buffers", view["buffer"])
        data = self.buffers[view["buffer"]]
        start = view.get("byteOffset", 0)
        end = start + view["byteLength"]
        if not 0 <= start <= end <= len(data):
            raise ModelError(_beyond(end, len(data)))
        return data[start:end]

    def resource(self, uri: str) -> bytes:
        """The bytes of a data URI or of a file beside the model."""
        return _resource(self.folder, uri)


def _beyond(end: int, size: int) -> str:
    return f"byte {end:,} of {size:,} is requested; copy or export it again"


def read_gltf_file(data: bytes, folder: Path) -> GltfFile:
    """The glTF file with this content. Raises ModelError if it is incomplete or requires an unknown extension.

    `folder` is the folder that contains the file.
    """
    is_binary = data[:4] == b"glTF"
    text, blob = _chunks(data) if is_binary else (data, b"")
    if not text.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"{"):
        raise ModelError("begins like neither .glb nor .gltf; is it of another format?")
    tree = json.loads(text.decode("utf-8-sig"))
    _require_readable(tree)

    buffers = []
    for buffer in tree.get("buffers", []):
        content = _resource(folder, buffer["uri"]) if "uri" in buffer else blob
        buffers.append(memoryview(content))
    return GltfFile(folder, tree, tuple(buffers), _unread(tree))


def _require_readable(tree: Json) -> None:
    """Raise ModelError for another version of glTF, or a required extension that is not read."""
    version = tree["asset"]["version"]
    if not str(version).startswith("2."):
        raise ModelError(f"is glTF {version}, not 2; gltf-pipeline -i old.gltf -o new.glb converts it")
    for name in tree.get("extensionsRequired", []):
        unknown = f"needs the extension {name}, which is unknown here; export it without"
        if fault := EXTENSIONS.get(name, unknown):
            raise ModelError(fault)


def _unread(tree: Json) -> tuple[str, ...]:
    """Notes on optional extensions that are not read."""
    used = sorted(tree.get("extensionsUsed", []))
    notes = [f"{name} is not read" for name in used if EXTENSIONS.get(name, name)]
    if tree.get("animations"):
        notes.append("animations are not played")
    return tuple(notes)


def _chunks(data: bytes) -> tuple[bytes, bytes]:
    """The JSON and the binary chunk of a .glb."""
    version, length, json_bytes, kind = struct.unpack_from("<III4s", data, 4)
    if version != 2:
        raise ModelError(f"is glTF {version}, not 2; export it again as glTF 2.0")
    json_end = GLB_HEADER_BYTES + json_bytes
    if length > len(data) or json_end > length or kind != b"JSON":
        raise ModelError(f"has {len(data):,} of {length:,} bytes, or they are damaged; copy or export it again")

    text = data[GLB_HEADER_BYTES:json_end]
    rest = data[json_end:length]
    if len(rest) <= CHUNK_HEADER_BYTES:
        return text, b""
    (blob_bytes,) = struct.unpack_from("<I", rest)
    return text, rest[CHUNK_HEADER_BYTES : CHUNK_HEADER_BYTES + blob_bytes]


def _resource(folder: Path, uri: str) -> bytes:
    """The bytes of a data URI or of a file beside the model."""
    if uri.startswith("data:"):
        encoded = uri.partition(",")[2]
        return base64.b64decode(encoded, validate=True)
    name = unquote(uri)
    file = folder / name
    if Path(name).is_absolute() or not file.is_file() or file.stat().st_size > MOST_BYTES:
        raise ModelError(f"needs '{name[:80]}', which is not beside it; put it there, or export one .glb")
    return file.read_bytes()
