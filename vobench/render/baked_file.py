"""A baked scene on disk: one .npy per map, read back without a copy."""

import json
import zipfile
from dataclasses import asdict
from pathlib import Path

import numpy as np

from vobench.errors import RenderError
from vobench.render.bake import BakedScene, BakeSettings, SunTrack, moving_suns
from vobench.render.lightmap import Layout, Patch
from vobench.scene.material import texture_of
from vobench.scene.scene import Scene

LIGHT, PATCHES, SETTINGS = "light.npy", "patches.npy", "settings.json"


def save_baked(folder: Path, baked: BakedScene) -> None:
    """Write the maps of a baked scene into a folder."""
    (folder / SETTINGS).write_text(json.dumps(asdict(baked.settings)))
    np.save(folder / LIGHT, baked.light)
    patches = [(p.row, p.column, p.rows, p.columns) for p in baked.layout.patches]
    np.save(folder / PATCHES, np.array(patches, np.int32))
    for name, tile in baked.albedo.items():
        np.save(folder / f"albedo.{name}.npy", tile)
    for track in baked.tracks:
        np.savez(folder / f"sun.{track.light}.npz", times_ns=track.times_ns, bounced=track.bounced)


def load_baked(folder: Path, scene: Scene) -> BakedScene:
    """The maps that `save_baked` wrote, for the same scene. Raises RenderError where they are damaged."""
    try:
        settings = BakeSettings(**json.loads((folder / SETTINGS).read_text()))
        light = np.load(folder / LIGHT)
        patches = tuple(Patch(*row) for row in np.load(folder / PATCHES).tolist())
        bodies = [name for name, material in sorted(scene.materials.items()) if texture_of(material)]
        albedo = {name: np.load(folder / f"albedo.{name}.npy") for name in bodies}
        tracks = tuple(_track(folder / f"sun.{sun}.npz", sun) for sun in moving_suns(scene))
    except (OSError, EOFError, ValueError, KeyError, TypeError, zipfile.BadZipFile) as error:
        raise RenderError(f"the scene's light cannot be read ({error}); delete this folder: {folder}") from error
    return BakedScene(scene, Layout(patches, *light.shape[1:]), light, albedo, settings, tracks)


def _track(path: Path, sun: int) -> SunTrack:
    with path.open("rb") as file, np.load(file) as stored:  # np.load leaves a torn file open
        return SunTrack(sun, tuple(stored["times_ns"].tolist()), stored["bounced"])
