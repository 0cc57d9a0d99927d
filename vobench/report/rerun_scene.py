"""The scene of a case in a Rerun recording: its faces with the light that its pictures were drawn with."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
from numpy.typing import NDArray
from pydantic import ValidationError

from vobench.errors import VobenchError
from vobench.geometry.se3 import Array
from vobench.rendering.baked_file import load_baked
from vobench.rendering.baked_scene import BakedScene
from vobench.rendering.illumination import Illumination
from vobench.rendering.texel_owner import owners
from vobench.rendering.wet_ground import wetted
from vobench.report.entity import SCENE
from vobench.report.rerun_stream import FrameStream
from vobench.runner.folder import CASE, SEQUENCE, RunFolder
from vobench.scene.material import Material, linear_texture, srgb
from vobench.scene.scene import MoverMotion
from vobench.suite.scene_build import build
from vobench.suite.scene_spec import LightOverride, SceneFile
from vobench.suite.yaml_file import checked

INPUTS = "inputs.json"  # of a sequence: the entries of the store that it was made from
MOST_TEXELS = 1024  # on a side of the light map that is shown
WHITE_PERCENTILE = 98.0  # of the lit texels, which the brightest value shown stands for
LEAST_WHITE = 1e-9
GREY = (128, 128, 128)


@dataclass(frozen=True, slots=True)
class SceneMesh:
    """The faces of a scene: corners (F, 3, 3), light map (H, W, 3) and places on it (F, 3, 2), colours (F, 3).

    `mover` (F,) is -1 for stationary faces. The others are in the frame of the mover with that index, which follows
    the path with the same index.
    """

    corners_m: Array
    light_uv: Array
    light: NDArray[np.uint8]
    colors: NDArray[np.uint8]
    mover: NDArray[np.int32]
    paths: tuple[MoverMotion, ...] = ()

    def mesh(self, faces: NDArray[np.bool_]) -> rr.Mesh3D:
        """The selected faces (F,) as a mesh."""
        vertices = 3 * np.count_nonzero(faces)
        return rr.Mesh3D(
            vertex_positions=self.corners_m[faces].reshape(-1, 3),
            triangle_indices=np.arange(vertices, dtype=np.uint32).reshape(-1, 3),
            vertex_texcoords=self.light_uv[faces].reshape(-1, 2),
            vertex_colors=np.repeat(self.colors[faces], 3, axis=0),
            albedo_texture=self.light,
            face_rendering=rr.components.MeshFaceRendering.Front,  # from outside, walls are transparent
        )


def log_scene(log: FrameStream, scene: SceneMesh) -> None:
    """Log the stationary faces as one mesh, and those of each mover as a mesh with a pose per frame."""
    log.static(SCENE, scene.mesh(scene.mover < 0))
    for index, path in enumerate(scene.paths):
        entity = f"{SCENE}/mover_{index}"
        log.static(entity, scene.mesh(scene.mover == index))
        poses = [path.pose(t_ns) for t_ns in log.t_ns.tolist()]
        log.poses(entity, np.arange(log.count), np.stack(poses))


def scene_mesh(folder: RunFolder, case: str) -> SceneMesh | None:
    """The scene of a case with its baked light, None if it has none or its light is no longer in the cache."""
    settings = _json(folder.case(case) / CASE)
    baked = _baked_folder(folder.case(case) / SEQUENCE)
    if "scene" not in settings or baked is None:
        return None
    try:
        lighting = {name: checked(LightOverride, value) for name, value in settings["lighting"].items()}
        scene = build(checked(SceneFile, settings["scene"]), lighting)
        light = load_baked(baked, wetted(scene))
    except (VobenchError, ValidationError):
        return None
    return SceneMesh(
        corners_m=light.faces.corners_m,
        light_uv=light.light_uv,
        light=_light_texture(light),
        colors=_face_colors(light),
        mover=light.faces.mover,
        paths=tuple(mover.path for mover in light.scene.movers),
    )


def _json(path: Path) -> dict[str, Any]:
    content: dict[str, Any] = json.loads(path.read_bytes()) if path.is_file() else {}
    return content


def _baked_folder(sequence: Path) -> Path | None:
    """The store's entry of the light that a sequence was drawn with, None if it is gone."""
    folder = sequence.resolve()
    needs = _json(folder / INPUTS).get("needs", [])
    store = folder.parents[1]
    for need in needs:
        entry = store / str(need)
        if entry.is_dir():
            return entry
    return None


def _light_map(light: BakedScene) -> NDArray[np.float32]:
    """The light at the start (H, W, 3). That of movers depends on where they are: they have the mean of the others."""
    radiance = Illumination(light).at(0, 0)
    if not light.scene.movers:
        return radiance
    face = owners(light.atlas).face.reshape(radiance.shape[:2])
    is_mover = (face >= 0) & (light.faces.mover[face] >= 0)
    mean = radiance[radiance > 0].mean() if radiance.any() else 0.0
    return np.where(is_mover[..., None], np.float32(mean), radiance)


def _light_texture(light: BakedScene) -> NDArray[np.uint8]:
    """The light map at the start, (H, W, 3) in sRGB, with at most MOST_TEXELS on a side."""
    radiance = _light_map(light)
    step = -(-max(radiance.shape) // MOST_TEXELS)
    radiance = radiance[::step, ::step]
    lit = radiance[radiance > 0]
    white = float(np.percentile(lit, WHITE_PERCENTILE)) if lit.size else 1.0
    texture: NDArray[np.uint8] = srgb(radiance / max(white, LEAST_WHITE))
    return texture


def _face_colors(light: BakedScene) -> NDArray[np.uint8]:
    """The colour of each face (F, 3) in sRGB, grey for one without a material."""
    materials = [light.scene.materials.get(thing.material) for thing in light.faces.things]
    colors = [srgb(_mean_reflectance(material)) if material else GREY for material in materials]
    face_colors: NDArray[np.uint8] = np.array(colors, np.uint8)[light.faces.thing]
    return face_colors


def _mean_reflectance(material: Material) -> Array:
    """The mean reflectance of a material (3,)."""
    reflectance = np.array(material.colour)
    if material.texture:
        reflectance = reflectance * linear_texture(material.texture).mean((0, 1))
    return reflectance
