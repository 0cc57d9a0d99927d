"""OBJ, STL and PLY files as the .glb that trimesh makes of them."""

import re
from collections.abc import Iterator
from pathlib import Path

from vobench.asset.gltf_file import MOST_FACES
from vobench.errors import ModelError


def read_as_glb(path: Path) -> bytes:
    """The .glb of a file, all its materials diffuse or coated, never metal, and pictures in their own colours.

    Raises ModelError where trimesh cannot read it, where it has too many faces, or needs a file that is missing.
    """
    import trimesh

    _require_readable(path)
    try:
        scene = trimesh.load_scene(path, process=False)
        for mesh in scene.geometry.values():
            if mesh.visual.kind == "texture":
                _without_metal(mesh.visual)
        return bytes(trimesh.exchange.gltf.export_glb(scene))  # type: ignore[no-untyped-call]
    except Exception as error:  # trimesh raises all kinds
        raise ModelError(f"trimesh cannot read it ({error or type(error).__name__}); export it as .glb") from error


def _without_metal(visual: object) -> None:
    """Replace a visual's material by one of glTF that is no metal, whose texture is not tinted."""
    material = visual.material  # type: ignore[attr-defined]
    physical = material.to_pbr()
    physical.name = getattr(material, "name", None)
    physical.metallicFactor = 0.0
    if physical.baseColorTexture is not None:
        physical.baseColorFactor = None
    visual.material = physical  # type: ignore[attr-defined]


def _require_readable(path: Path) -> None:
    """Refuse too many faces before trimesh reads any, and an OBJ whose materials or pictures are lost."""
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
        raise ModelError("is of no format that is read: .glb, .gltf, .obj, .stl, .ply")
    if faces > MOST_FACES:
        advice = "make them fewer, as by Blender's Decimate"
        raise ModelError(f"has {faces:,} faces, more than {MOST_FACES:,}; {advice}")


def _require_beside(folder: Path, obj: bytes) -> None:
    """Refuse an OBJ whose material files, or the pictures of these, are missing."""
    for name in _files_needed(folder, obj):
        if not (folder / name).is_file():
            raise ModelError(f"needs '{name}', which is not beside it; put it there, or export one .glb")


def _files_needed(folder: Path, obj: bytes) -> Iterator[str]:
    """The material files of an OBJ, then the pictures of each."""
    libraries = [_text(name) for name in re.findall(rb"^mtllib\s+(.+?)\s*$", obj, re.M)]
    yield from libraries
    for library in libraries:
        file = folder / library
        if file.is_file():
            pictures = re.findall(rb"^\s*map_Kd\s+(?:.*\s)?(\S+)\s*$", file.read_bytes(), re.M)
            yield from map(_text, pictures)


def _text(name: bytes) -> str:
    return name.decode("utf-8", "replace")
