"""Reads the YAML file of a scene, or a model as a scene, and resolves the paths in it."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

from vobench.asset import MODEL_SUFFIXES
from vobench.errors import SuiteError
from vobench.suite import catalog, yaml_file
from vobench.suite.bare_model import bare_model_scene
from vobench.suite.scene_check import check_scene
from vobench.suite.scene_code import code_identity
from vobench.suite.scene_entry import DRAWN, described_scene, generated_scene
from vobench.suite.scene_spec import ModelSpec, MoverSpec, SceneFile
from vobench.suite.yaml_source import Mistakes, YamlFile


def read_scene(path: Path) -> SceneFile:
    """The scene in a file. Raises SuiteError with all mistakes, each with its place."""
    spec, mistakes = read_scene_with_mistakes(path)
    mistakes.require_none()
    return spec


def read_place(scene: str, *, seed: int | None = None, lighting: str = DRAWN) -> SceneFile:
    """A scene by its name or path: as its file describes it or, with a seed, as its generator creates it.

    Raises UnknownNameError if there is no such scene. Raises SuiteError if its file is wrong, if there is a
    seed and the scene has no generator, or if there is no seed and the scene has only a generator.
    """
    entry = catalog.find("scene", scene)
    spec = read_scene(entry.path)
    if seed is None:
        return described_scene(spec)
    return generated_scene(spec, seed, lighting)


def read_scene_with_mistakes(
    path: Path, changes: Mapping[str, Any] = MappingProxyType({})
) -> tuple[SceneFile, Mistakes]:
    """The scene in a file, and all mistakes in it. If there are mistakes, the scene is incomplete.

    `changes` replaces values of the file; the keys of nested values are joined by dots.
    """
    if path.suffix.lower() in MODEL_SUFFIXES:
        if changes:
            raise SuiteError(f"scene_changes require a scene in YAML, but this is a model: {path}")
        return bare_model_scene(path), Mistakes(YamlFile(path, {}))

    changes_in_yaml = {key: json.dumps(value) for key, value in changes.items()}
    reading = yaml_file.read_all(path, SceneFile, changes_in_yaml, kind="scene")
    mistakes = Mistakes(reading.source, list(reading.mistakes))
    check_scene(reading.model, mistakes)
    if reading.mistakes:
        return reading.model, mistakes
    spec = _with_absolute_paths(reading.model, path.parent, mistakes)
    if spec.generated:
        spec = generated_scene(spec, spec.generated.seed, spec.generated.lighting)
    return spec, mistakes


def _with_absolute_paths(spec: SceneFile, folder: Path, mistakes: Mistakes) -> SceneFile:
    """The scene with absolute paths of its files. Relative paths start at `folder`.

    A file that does not exist is added to the mistakes, with the keys under which the scene names it.
    """

    def absolute(name: str, *keys: int | str) -> str:
        path = folder / name
        with mistakes.at(*keys):
            if not path.is_file():
                raise SuiteError(f"there is no such file beside the scene: {path}")
        return str(path.resolve())

    def absolute_if_any(name: str | None, *keys: int | str) -> str | None:
        return absolute(name, *keys) if name else name

    meshes = list[ModelSpec]()
    for index, mesh in enumerate(spec.meshes):
        meshes.append(replace(mesh, file=absolute(mesh.file, "meshes", index, "file")))
    movers = list[MoverSpec]()
    for index, mover in enumerate(spec.movers):
        movers.append(replace(mover, file=absolute_if_any(mover.file, "movers", index, "file")))
    maker = absolute_if_any(spec.maker, "maker")
    generator = absolute_if_any(spec.generator, "generator")
    return replace(spec, meshes=tuple(meshes), movers=tuple(movers), maker=maker, generator=generator)


def scene_content(spec: SceneFile, *, exclude: Any = None) -> dict[str, Any]:
    """The scene as plain JSON values. Files are identified by their name and content, not by their path.

    Makers and generators are identified by all Python files of their folders. The generator is omitted if the scene was
    not created by it.
    """
    scene: dict[str, Any] = yaml_file.plain(spec, exclude=exclude)
    if spec.generated is None:
        scene.pop("generator", None)
        scene.pop("generated", None)
    elif spec.generator:
        scene["generator"] = code_identity(Path(spec.generator))
    for part in (*scene.get("meshes", ()), *scene.get("movers", ())):
        if part.get("file"):
            part["file"] = _file_identity(Path(part["file"]))
    if scene.get("maker"):
        scene["maker"] = code_identity(Path(scene["maker"]))
    return scene


def _file_identity(path: Path) -> str:
    """The name of a file, and the SHA-256 hash of its content."""
    content_hash = hashlib.sha256(path.read_bytes()).hexdigest()
    return f"{path.name} {content_hash}"
