"""A model file as a scene, with the model's own lights or suitable ones."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vobench.geometry.triangle import areas_m2
from vobench.scene.light import Light, Sky, Sun
from vobench.scene.material import LUMINANCE, Material, emitted_cd_m2, reflectance
from vobench.scene.mesh import face_corners
from vobench.scene.scene import Scene
from vobench.suite.scene_spec import ModelSpec, SceneFile

if TYPE_CHECKING:
    from vobench.asset.model import Model

# A larger model is probably in centimetres.
LARGEST_M = 300.0
CENTIMETRE = 0.01

WHITEST = 0.9  # largest mean reflectance: at 1, light would be reflected for ever
OTHER_REFLECTANCE = 0.5  # of mirrors and panes
LEAST_LX = 5.0  # mean illuminance by the model's own lights, below which others are added


def bare_model_scene(path: Path) -> SceneFile:
    """A model as a scene, with lights if its own give less than LEAST_LX; white follows from the light that is seen.

    In a closed room of area A and mean reflectance r, lamps of total power P give an illuminance of P / (A (1 - r)),
    bounces included. A is the area of the faces that can be seen from the free space.
    """
    from vobench.asset.model import read_model
    from vobench.suite.default_light import DAYLIGHT_SKY, DAYLIGHT_SUN, DUSK_SKY, default_light

    model = read_model(path)
    scale = _scale(model)
    if scale != 1:
        model = read_model(path, scale=scale)
    things = tuple(model.all_things)
    name = _scene_name(path)
    whole_model = ModelSpec(file=str(path.resolve()), scale=scale)
    spec = SceneFile(name=name, meshes=(whole_model,))

    properties = {name: _optical_properties(material) for name, material in model.materials.items()}
    properties_by_thing = np.array([properties[thing.material] for thing in things])  # (T, 2)
    emission_cd_m2 = properties_by_thing[:, 0]
    absorption = 1 - properties_by_thing[:, 1]
    light = default_light(Scene(name, things, {}, ()), absorption)

    area_m2 = np.array([areas_m2(face_corners(thing.mesh)).sum() for thing in things])  # (T,)
    luminous_faces_lm = float(np.pi * area_m2 @ emission_cd_m2)
    lamps_lx = (_lamp_power_lm(model.lights) + luminous_faces_lm) / light.absorption_m2
    has_enough_light = _daylight_lx(model.lights) + lamps_lx >= LEAST_LX
    if has_enough_light:
        return spec
    if light.lamps:
        return replace(spec, lamps=light.lamps, sky=DUSK_SKY if light.has_windows else None)
    return replace(spec, sun=DAYLIGHT_SUN, sky=DAYLIGHT_SKY)


def _scale(model: "Model") -> float:
    """The factor from the units of a model to metres."""
    corners_m = np.concatenate([thing.mesh.vertices for thing in model.all_things])
    extent_m = float(np.ptp(corners_m, axis=0).max())
    return CENTIMETRE if extent_m > LARGEST_M else 1.0


def _scene_name(path: Path) -> str:
    """The name of a file as the name of a scene."""
    return re.sub(r"[^a-z0-9_]+", "_", path.stem.lower()).strip("_") or "model"


def _optical_properties(material: Material) -> tuple[float, float]:
    """The luminance in cd/m² and the mean reflectance of a material."""
    luminance_cd_m2 = float(emitted_cd_m2(material) @ LUMINANCE)
    if material.kind != "body":
        return luminance_cd_m2, OTHER_REFLECTANCE
    return luminance_cd_m2, min(float(reflectance(material).mean()), WHITEST)


def _lamp_power_lm(lights: Sequence[Light]) -> float:
    return sum(light.power_lm for light in lights if not isinstance(light, Sun | Sky))


def _daylight_lx(lights: Sequence[Light]) -> float:
    return sum(light.illuminance_lx for light in lights if isinstance(light, Sun | Sky))
