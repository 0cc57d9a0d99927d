"""A baked scene on disk: one .npy per map, read back without a copy."""

from pathlib import Path

import numpy as np

from vobench.errors import RenderError
from vobench.render.bake import BakedScene
from vobench.render.lightmap import Layout, Patch
from vobench.scene.scene import Scene

LIGHT, PATCHES = "illuminance.npy", "patches.npy"


def save_baked(folder: Path, baked: BakedScene) -> None:
    """Write the maps of a baked scene into a folder."""
    np.save(folder / LIGHT, baked.illuminance)
    patches = [(p.row, p.column, p.rows, p.columns) for p in baked.layout.patches]
    np.save(folder / PATCHES, np.array(patches, np.int32))
    for name, tile in baked.albedo.items():
        np.save(folder / f"albedo.{name}.npy", tile)


def load_baked(folder: Path, scene: Scene) -> BakedScene:
    """The maps that `save_baked` wrote, for the same scene. Raises RenderError where they are damaged."""
    try:
        illuminance = np.load(folder / LIGHT)
        patches = tuple(Patch(*row) for row in np.load(folder / PATCHES).tolist())
        albedo = {name: np.load(folder / f"albedo.{name}.npy") for name in scene.textures}
    except (OSError, ValueError) as error:
        raise RenderError(f"the scene's light cannot be read ({error}); delete this folder: {folder}") from error
    return BakedScene(scene, Layout(patches, *illuminance.shape), illuminance, albedo)
