"""Converts OBJ, STL and PLY files to .glb with trimesh."""

import re
from collections.abc import Iterator
from pathlib import Path

from vobench.asset.gltf_file import MOST_FACES
from vobench.errors import ModelError


def read_as_glb(path: Path) -> bytes:
    """The file converted to .glb. No material is a metal, and textures are not tinted.

    Raises ModelError if trimesh cannot read the file, if it has too many faces, or if a file that it needs is missing.
    """
    import trimesh

    _require_readable(path)
    try:
        scene = trimesh.load_scene(path, process=False)
        for mesh in scene.geometry.values():
            if mesh.visual.kind == "texture":
                _without_metal(mesh.visual)
        return bytes(trimesh.exchange.gltf.export_glb(scene))  # type: ignore[no-untyped-call]
    except Exception as error:  # trimesh raises errors of many types
        raise ModelError(f"trimesh cannot read it ({error or type(error).__name__}); export it as .glb") from error


def _without_metal(visual: object) -> None:
    """Replace the material of a visual by a physically based one that is not a metal and does not tint its texture."""
    material = visual.material  # type: ignore[attr-defined]
    physical = material.to_pbr()
    physical.name = getattr(material, "name", None)
    physical.metallicFactor = 0.0
    if physical.baseColorTexture is not None:
        physical.baseColorFactor = None
    visual.material = physical  # type: ignore[attr-defined]


def _require_readable(path: Path) -> None:
    """Raise ModelError for a file with too many faces, before trimesh reads it, and for an OBJ with missing files."""
    data = path.read_bytes()
    kind = path.suffix.lower()
    if kind == ".obj":
        faces = data.count(b"\nf ")
        _require_beside(path.parent, data)
    elif kind == ".stl":
        faces = data.count(b"facet normal") or int.from_bytes(data[80:84], "little")
    elif kind == ".ply":
        header = data[:65536]
        counts = re.findall(rb"element (?:face|vertex) (\d+)", header)
        faces = max(map(int, counts), default=0) // 2
    else:
        raise ModelError("is of an unknown format; known formats are .glb, .gltf, .obj, .stl, .ply")
    if faces > MOST_FACES:
        advice = "make them fewer, as by Blender's Decimate"
        raise ModelError(f"has {faces:,} faces, more than {MOST_FACES:,}; {advice}")


def _require_beside(folder: Path, obj: bytes) -> None:
    """Raise ModelError for an OBJ if one of its material files or pictures is missing."""
    for name in _files_needed(folder, obj):
        if not (folder / name).is_file():
            raise ModelError(f"needs '{name}', which is not beside it; put it there, or export one .glb")


def _files_needed(folder: Path, obj: bytes) -> Iterator[str]:
    """The names of the material files of an OBJ, and of the pictures that they use."""
    libraries = [_text(name) for name in re.findall(rb"^mtllib\s+(.+?)\s*$", obj, re.M)]
    yield from libraries
    for library in libraries:
        file = folder / library
        if file.is_file():
            pictures = re.findall(rb"^\s*map_Kd\s+(?:.*\s)?(\S+)\s*$", file.read_bytes(), re.M)
            yield from map(_text, pictures)


def _text(name: bytes) -> str:
    return name.decode("utf-8", "replace")
