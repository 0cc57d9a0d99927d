"""Writes models whose textured surfaces emit light and reflect none, as glTF. Source: Khronos, glTF 2.0."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from trimesh import Scene, Trimesh
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

from vobench.geometry.se3 import Array


@dataclass(frozen=True, slots=True)
class Surface:
    """Vertices (V, 3) in metres, their texture coordinates (V, 2) from 0 to 1, faces (F, 3) and the texture (H, W)."""

    vertices_m: Array
    uv: Array
    faces: NDArray[np.int64]
    texture: NDArray[np.uint8]


def write_luminous_model(surfaces: Sequence[Surface], path: Path) -> None:
    """Write surfaces as a glTF binary file with y up. They emit 1 cd/m² where the texture is white."""
    scene = Scene()
    for number, surface in enumerate(surfaces):
        colour = np.repeat(surface.texture[..., None], 3, axis=-1)
        material = PBRMaterial(  # type: ignore[no-untyped-call]
            name=f"image_{number}",
            emissiveTexture=Image.fromarray(colour),
            emissiveFactor=[1.0, 1.0, 1.0],
            baseColorFactor=[0, 0, 0, 255],
            metallicFactor=0.0,
            roughnessFactor=1.0,
        )
        # trimesh has texture coordinates with v up, and glTF files have y up.
        uv = np.column_stack([surface.uv[:, 0], 1 - surface.uv[:, 1]])
        vertices_m = surface.vertices_m[:, [0, 2, 1]] * [1, 1, -1]
        visual = TextureVisuals(uv=uv, material=material)  # type: ignore[no-untyped-call]
        mesh = Trimesh(vertices_m, surface.faces, visual=visual, process=False)
        scene.add_geometry(mesh, node_name=f"image_{number}", geom_name=f"image_{number}")
    path.write_bytes(scene.export(file_type="glb"))  # type: ignore[no-untyped-call]
