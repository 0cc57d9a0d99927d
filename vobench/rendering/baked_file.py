"""Baked light on disk: the arrays of a baked scene, and the textures and panoramas that were generated for it."""

import json
import zipfile
from collections.abc import Mapping
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import scipy

from vobench.errors import RenderError, SettingError
from vobench.rendering.atlas import Atlas
from vobench.rendering.baked_scene import BakedScene, BakeSettings, Patches, SunTrack
from vobench.rendering.face_parts import FaceParts
from vobench.rendering.key_time import moving_suns
from vobench.scene.light import Light, Sky
from vobench.scene.material import Material, Picture, Texture
from vobench.scene.panorama import PanoramaMap
from vobench.scene.scene import Scene, triangles

TEXTURE_FIELDS = ("texture", "emission_texture")  # of materials
LIGHT_FILE = "light.npy"
SURFEL_FILE = "surfels.npz"
TEXTURE_FILE = "textures.npz"
SETTINGS_FILE = "settings.json"
NOISE_FILE = "noise.json"
SPREAD_ARRAYS = ("data", "indices", "indptr")


def save_baked(folder: Path, baked: BakedScene) -> None:
    """Write the light of a baked scene into a folder, and the textures and panoramas that were generated for it."""
    (folder / SETTINGS_FILE).write_text(json.dumps(asdict(baked.settings)))
    (folder / NOISE_FILE).write_text(json.dumps({"light_noise": baked.light_noise}))
    np.save(folder / LIGHT_FILE, baked.direct)
    spread = {f"spread_{name}": getattr(baked.spread, name) for name in SPREAD_ARRAYS}
    patches = {field.name: getattr(baked.patches, field.name) for field in fields(Patches)}
    np.savez(
        folder / SURFEL_FILE,
        light_px=baked.atlas.light_px,
        chart=baked.atlas.chart,
        parent=baked.parts.parent,
        weights=baked.parts.weights,
        bounced=baked.bounced,
        **spread,
        **patches,
    )
    for track in baked.tracks:
        np.savez(folder / f"sun.{track.light}.npz", times_ns=track.times_ns, bounced=track.bounced)
    np.savez(folder / TEXTURE_FILE, **_generated_pixels(baked))
    for index, light in enumerate(baked.scene.lights):
        if isinstance(light, Sky) and light.panorama is not None:
            shown = light.panorama.map_under(light)
            np.savez(folder / f"panorama.{index}.npz", daylight=shown.daylight, lamps=shown.lamps)


def _generated_pixels(baked: BakedScene) -> dict[str, Any]:
    """The pixels of all generated textures that the things of a baked scene show, by the names of `_textures`."""
    materials = baked.scene.materials
    names = {thing.material for thing in baked.faces.things} & materials.keys()
    shown_ids = {id(getattr(materials[name], part)) for name in names for part in TEXTURE_FIELDS}
    textures = _textures(materials).items()
    return {name: texture.pixels() for name, texture in textures if id(texture) in shown_ids}


def _textures(materials: Mapping[str, Material]) -> dict[str, Texture]:
    """The textures that are generated, not pictures, each by the first material and the field that have it."""
    named = dict[int, tuple[str, Texture]]()
    for name, material in reversed(list(materials.items())):
        for part in TEXTURE_FIELDS:
            texture = getattr(material, part)
            if texture is not None and not isinstance(texture, Picture):
                named[id(texture)] = (f"{name}.{part}", texture)
    return dict(named.values())


def _with_pictures(scene: Scene, pictures: Mapping[str, Any]) -> Scene:
    """The scene with pictures, by the names of `_textures`, instead of textures that would be generated again."""
    picture_by_id = {}
    for name, texture in _textures(scene.materials).items():
        if name in pictures:
            picture_by_id[id(texture)] = Picture(pictures[name], texture.tile_m)

    def with_pictures(material: Material) -> Material:
        textures = {part: getattr(material, part) for part in TEXTURE_FIELDS}
        replaced = {part: picture_by_id.get(id(texture), texture) for part, texture in textures.items()}
        return replace(material, **replaced)

    materials = {name: with_pictures(material) for name, material in scene.materials.items()}
    return replace(scene, materials=materials)


def _with_panoramas(scene: Scene, folder: Path) -> Scene:
    """The scene with the stored panoramas of its skies, which are not generated again."""
    lights = list[Light]()
    for index, light in enumerate(scene.lights):
        if isinstance(light, Sky) and light.panorama is not None:
            stored = _load(folder / f"panorama.{index}.npz")
            lights.append(replace(light, panorama=PanoramaMap(stored["daylight"], stored["lamps"])))
        else:
            lights.append(light)
    return replace(scene, lights=tuple(lights))


def load_baked(folder: Path, scene: Scene) -> BakedScene:
    """Read what `save_baked` wrote for the same scene. Raises RenderError if a file is missing or damaged."""
    try:
        settings = BakeSettings(**json.loads((folder / SETTINGS_FILE).read_text()))
        light_noise = float(json.loads((folder / NOISE_FILE).read_text())["light_noise"])
        pictured = _with_panoramas(_with_pictures(scene, _load(folder / TEXTURE_FILE)), folder)
        light = np.load(folder / LIGHT_FILE)
        arrays = _load(folder / SURFEL_FILE)
        tracks = []
        for sun in moving_suns(scene):
            track = _load(folder / f"sun.{sun}.npz")
            tracks.append(SunTrack(sun, tuple(track["times_ns"].tolist()), track["bounced"]))
        atlas = Atlas(arrays["light_px"], arrays["chart"], *light.shape[1:])
        patches = Patches(*(arrays[field.name] for field in fields(Patches)))
        texel_count = atlas.height * atlas.width
        spread_arrays = tuple(arrays[f"spread_{name}"] for name in SPREAD_ARRAYS)
        spread = scipy.sparse.csr_matrix(spread_arrays, (texel_count, len(patches.area_m2)))
    except (OSError, EOFError, ValueError, KeyError, TypeError, zipfile.BadZipFile, SettingError) as error:
        raise RenderError(f"the scene's light cannot be read ({error}); delete this folder: {folder}") from error
    parts = FaceParts(arrays["parent"], arrays["weights"])
    return BakedScene(
        pictured,
        parts,
        parts.of(triangles(scene)),
        atlas,
        light,
        arrays["bounced"],
        spread,
        patches,
        settings,
        tuple(tracks),
        light_noise,
    )


def _load(path: Path) -> dict[str, Any]:
    with path.open("rb") as file, np.load(file) as stored:  # np.load leaves a torn file open
        return dict(stored)
