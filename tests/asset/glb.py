"""A .glb in the making, for tests of its readers."""

import io
import json
import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
from PIL import Image

Json = dict[str, Any]
WIDTHS = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
KINDS = {"float32": 5126, "uint8": 5121, "int8": 5120, "uint16": 5123, "int16": 5122, "uint32": 5125}
# A triangle in glTF's axes, whose front looks along +z: to the south, -y, of the house.
CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


class Glb:
    """A .glb in the making: numbers and pictures are appended, all else is a dictionary."""

    def __init__(self, **tree: Any) -> None:
        self.blob = b""
        self.tree: Json = {"asset": {"version": "2.0"}, "bufferViews": [], "accessors": [], "images": [], **tree}

    def view(self, data: bytes, **more: Any) -> int:
        self.blob += bytes(-len(self.blob) % 4)
        self.tree["bufferViews"].append({"buffer": 0, "byteOffset": len(self.blob), "byteLength": len(data), **more})
        self.blob += data
        return len(self.tree["bufferViews"]) - 1

    def numbers(self, values: Any, kind: str = "float32", **more: Any) -> int:
        array = np.atleast_2d(np.asarray(values, kind))
        array = array.T if np.ndim(values) == 1 else array
        entry = {"bufferView": self.view(array.tobytes()), "componentType": KINDS[kind], "count": len(array)}
        self.tree["accessors"].append({**entry, "type": WIDTHS[array.shape[1]], **more})
        return len(self.tree["accessors"]) - 1

    def texture(self, pixels: Any, form: str = "PNG") -> Json:
        file = io.BytesIO()
        Image.fromarray(np.asarray(pixels, np.uint8)).save(file, form)
        self.tree["images"].append({"bufferView": self.view(file.getvalue()), "name": "grain"})
        self.tree.setdefault("textures", []).append({"source": len(self.tree["images"]) - 1})
        return {"index": len(self.tree["textures"]) - 1}

    def primitive(self, corners: Any = CORNERS, faces: Any = None, **more: Any) -> Json:
        """More: material, mode, or the accessors of further attributes by their names in capitals."""
        at = {"POSITION": self.numbers(corners), **{k: v for k, v in more.items() if k.isupper() or "_" in k}}
        index = {} if faces is None else {"indices": self.numbers(np.ravel(faces), "uint16")}
        return {"attributes": at, **index, **{k: v for k, v in more.items() if k not in at}}

    def bytes(self) -> bytes:
        self.tree["buffers"] = [{"byteLength": len(self.blob)}]
        chunks = [(json.dumps(self.tree).encode(), b"JSON", b" "), (self.blob, b"BIN\0", b"\0")]
        body = b"".join(
            struct.pack("<I4s", len(data) + -len(data) % 4, kind) + data + pad * (-len(data) % 4)
            for data, kind, pad in chunks
        )
        return b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body


def triangle(*, nodes: Sequence[Json] = ({},), material: Json | None = None, **more: Any) -> Glb:
    """One triangle at every node, of one material."""
    glb = Glb(**more)
    glb.tree["materials"] = [material or {"name": "default"}]
    glb.tree["meshes"] = [{"primitives": [glb.primitive(material=0)]}]
    glb.tree["nodes"] = [{"name": "tile", "mesh": 0, **node} for node in nodes]
    return glb
