"""Creates a scene from a model file: with the model's lights or default ones, and a suitable exposure."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from vobench.scene.light import Light, Sky, Sun
from vobench.scene.material import LUMINANCE, Material, emitted_cd_m2, reflectance
from vobench.scene.mesh import areas_m2, corners
from vobench.scene.scene import Scene
from vobench.suite.scene_spec import ModelSpec, PointLamp, SceneFile, SkySpec, SunSpec

# A larger model is probably in centimetres.
LARGEST_M = 300.0
CENTIMETRE = 0.01

# The lights of a scene whose model has none.
DAYLIGHT_SUN = SunSpec(illuminance_lx=30_000, azimuth_deg=30, elevation_deg=50)
DAYLIGHT_SKY = SkySpec(illuminance_lx=8_000, kind="clear")
LEAST_OPEN = 0.1  # the smallest share of the sky that is visible from the floor of an outdoor scene
ROOM_LX = 400.0

WHITEST = 0.9  # the largest mean reflectance; at 1, light would never be absorbed
OTHER_REFLECTANCE = 0.5  # the reflectance of mirrors and panes
LEAST_WHITE_CD_M2 = 1.0


def bare_model_scene(path: Path) -> SceneFile:
    """The scene of a model. Cameras are exposed for a white wall in the mean light of the model.

    In a closed room of area A and mean reflectance r, lamps of total power P give a mean illuminance of
    P / (A (1 - r)), including interreflections.
    """
    from vobench.asset.model import read_model

    model = read_model(path)
    corners_m = np.concatenate([thing.mesh.vertices for thing in model.everything])
    extent_m = float(np.ptp(corners_m, axis=0).max())
    scale = CENTIMETRE if extent_m > LARGEST_M else 1.0
    if scale != 1:
        model = read_model(path, scale=scale)

    properties = {name: _optical_properties(material) for name, material in model.materials.items()}
    properties_by_thing = np.array([properties[thing.material] for thing in model.everything])  # (T, 2)
    emission_cd_m2 = properties_by_thing[:, 0]
    reflectances = properties_by_thing[:, 1]
    area_m2 = np.array([areas_m2(corners(thing.mesh)).sum() for thing in model.everything])  # (T,)

    absorption_m2 = float(area_m2 @ (1 - reflectances))
    emitted_lm = _lamp_power_lm(model.lights) + np.pi * area_m2 @ emission_cd_m2
    illuminance_lx = _daylight_lx(model.lights) + float(emitted_lm) / absorption_m2

    name = re.sub(r"[^a-z0-9_]+", "_", path.stem.lower()).strip("_") or "model"
    white_cd_m2 = max(float(illuminance_lx / np.pi), LEAST_WHITE_CD_M2)
    whole_model = ModelSpec(file=str(path.resolve()), scale=scale)
    spec = SceneFile(name=name, white_cd_m2=white_cd_m2, meshes=(whole_model,))
    if illuminance_lx:
        return spec
    return _with_default_light(spec, Scene(name, tuple(model.everything), {}, ()), absorption_m2)


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


def _with_default_light(spec: SceneFile, shape: Scene, absorption_m2: float) -> SceneFile:
    """The scene with daylight if the sky is visible from its floor, and otherwise with lamps below its ceiling."""
    from vobench.suite.free_space import ceiling_above

    sky_share, lamp_positions_m = ceiling_above(shape)
    if sky_share >= LEAST_OPEN:
        sine = np.sin(np.deg2rad(DAYLIGHT_SUN.elevation_deg or 90))
        illuminance_lx = DAYLIGHT_SUN.illuminance_lx * sine + DAYLIGHT_SKY.illuminance_lx
        return replace(spec, sun=DAYLIGHT_SUN, sky=DAYLIGHT_SKY, white_cd_m2=float(illuminance_lx / np.pi))

    power_lm = ROOM_LX * absorption_m2 / len(lamp_positions_m)
    lamps = list[PointLamp]()
    for number, position_m in enumerate(lamp_positions_m, 1):
        lamps.append(PointLamp(name=f"lamp_{number}", center_m=position_m, power_lm=power_lm))
    return replace(spec, lamps=tuple(lamps), white_cd_m2=float(ROOM_LX / np.pi))
