"""Converts OBJ, STL and PLY files to .glb with trimesh."""

import re
from pathlib import Path

from vobench.asset.gltf_file import MOST_FACES
from vobench.errors import ModelError

STL_HEAD_BYTES = 84
STL_FACE_BYTES = 50


def read_as_glb(path: Path) -> tuple[bytes, list[str]]:
    """The file converted to .glb, and notes on what it lacks. No material is a metal, and textures are not tinted.

    Surfaces of an OBJ whose material file is missing have no material. Raises ModelError if trimesh cannot read the
    file, if it has too many faces, or if a picture is missing.
    """
    import trimesh

    notes = _require_readable(path)
    try:
        scene = trimesh.load_scene(path, process=False)
        for mesh in scene.geometry.values():
            if notes:
                mesh.visual = trimesh.visual.ColorVisuals()
            elif mesh.visual.kind == "texture":
                _without_metal(mesh.visual)
        return bytes(trimesh.exchange.gltf.export_glb(scene)), notes  # type: ignore[no-untyped-call]
    except Exception as error:  # trimesh raises all kinds
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


def _require_readable(path: Path) -> list[str]:
    """Notes on material files that an OBJ lacks.

    Raises ModelError for too many faces, before trimesh reads any, and for an OBJ whose pictures are missing.
    """
    data = path.read_bytes()
    kind = path.suffix.lower()
    notes = list[str]()
    if kind == ".obj":
        faces = data.count(b"\nf ")
        notes = _notes_on_missing(path.parent, data)
    elif kind == ".stl":
        faces = data.count(b"facet normal") or _binary_stl_faces(data)
    elif kind == ".ply":
        header = data[:65536]
        counts = re.findall(rb"element (?:face|vertex) (\d+)", header)
        faces = max(map(int, counts), default=0) // 2
    else:
        raise ModelError("is of an unknown format; known formats are .glb, .gltf, .obj, .stl, .ply")
    if faces > MOST_FACES:
        advice = "make them fewer, as by Blender's Decimate"
        raise ModelError(f"has {faces:,} faces, more than {MOST_FACES:,}; {advice}")
    if kind == ".stl":
        _require_whole_stl(data)
    return notes


def _binary_stl_faces(data: bytes) -> int:
    """The number of faces that the head of a binary STL states."""
    return int.from_bytes(data[80:STL_HEAD_BYTES], "little")


def _require_whole_stl(data: bytes) -> None:
    """Raise ModelError for an STL that is neither a whole binary file nor a text.

    trimesh takes a torn binary file for a text where a package for guessing encodings is installed.
    """
    expected = STL_HEAD_BYTES + STL_FACE_BYTES * _binary_stl_faces(data)
    is_text = b"endsolid" in data
    if len(data) != expected and not is_text:
        raise ModelError(f"has {len(data):,} bytes, but its head states {expected:,}: is it cut off? Export it as .glb")


def _notes_on_missing(folder: Path, obj: bytes) -> list[str]:
    """Notes on the material files that an OBJ names and that are missing.

    Raises ModelError if a picture is missing that one of the others uses.
    """
    libraries = [_text(name) for name in re.findall(rb"^mtllib\s+(.+?)\s*$", obj, re.M)]
    notes = list[str]()
    for library in libraries:
        file = folder / library
        if not file.is_file():
            notes.append(f"its material file '{library}' is not beside it: read as grey and diffuse")
            continue
        for picture in re.findall(rb"^\s*map_Kd\s+(?:.*\s)?(\S+)\s*$", file.read_bytes(), re.M):
            name = _text(picture)
            if not (folder / name).is_file():
                raise ModelError(f"needs '{name}', which is not beside it; put it there, or export one .glb")
    return notes


def _text(name: bytes) -> str:
    return name.decode("utf-8", "replace")
