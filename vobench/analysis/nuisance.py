"""What makes a case hard, each as a change of its settings that takes it away."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from vobench.geometry.rig import CalibrationError
from vobench.sensor.image_sensor import CameraSensor, Eyes
from vobench.sensor.response import FULL_SCALE_DN, linear_of_grey
from vobench.suite.scene_file import materials_used
from vobench.suite.scene_spec import (
    STEADY,
    Glass,
    LevelSpec,
    LightOverride,
    MaterialSpec,
    Matt,
    Mirror,
    PanelLamp,
    Polished,
    SceneFile,
    SkySpec,
)
from vobench.suite.suite import Case

LEAST_SHOWN = 2e-3  # of a picture's pixels


@dataclass(frozen=True, slots=True)
class Nuisance:
    """One of NUISANCES: its name, what the case has instead once it is removed, and the change that does it.

    A case does not have it where the change leaves the case as it is, or where `shown_by`, one of the conditions of
    its frames, is 0 in all of them.
    """

    name: str
    instead: str
    remove: Callable[[Case], Case]
    shown_by: str | None = None


def nuisances_of(case: Case, largest: Mapping[str, float] = MappingProxyType({})) -> tuple[Nuisance, ...]:
    """Those of NUISANCES that the case has; `largest` are conditions' largest values, where they are known."""
    shown = (each for each in NUISANCES if largest.get(each.shown_by or "", 1.0) > LEAST_SHOWN)
    return tuple(each for each in shown if each.remove(case) != case)


def without(case: Case, removed: Iterable[str]) -> Case:
    """The case with these nuisances removed."""
    for nuisance in NUISANCES:
        if nuisance.name in set(removed):
            case = nuisance.remove(case)
    return case


def _camera(**changes: Any) -> Callable[[Case], Case]:
    return lambda case: replace(case, camera=replace(case.camera, **changes))


def _timed(**changes: Any) -> Callable[[Case], Case]:
    return lambda case: _camera(timing=replace(case.camera.timing, **changes))(case)


def _of_scene(change: Callable[[SceneFile], SceneFile]) -> Callable[[Case], Case]:
    return lambda case: replace(case, scene=change(case.scene))


def _of_materials(change: Callable[[str, MaterialSpec | None], MaterialSpec | None]) -> Callable[[Case], Case]:
    """Another material in place of each one that is used; it is given by name, None where it is a finish of ours."""

    def changed(scene: SceneFile) -> SceneFile:
        own = dict(scene.materials)
        used = {name for _, name in materials_used(scene)} | set(scene.materials)
        for name in sorted(used):
            if (other := change(name, own.get(name))) is not None and other != own.get(name):
                own[name] = other
        return replace(scene, materials=own)

    return _of_scene(changed)


# In place of a mirror: something that can be followed, or low texture would come in its place.
STONE = Matt("terrazzo", 0.45, contrast=0.5)
# The finishes that mirror, and those in which there is little to see; others have a picture for a texture.
COATED_FINISHES = {"terrazzo": Matt("terrazzo", 0.45, contrast=0.4)}
FAINT_FINISHES = ("white_plaster", "sage_plaster", "paint")
# contrasts
FAINT = 0.3
STRONG = 0.7


def _matt_mirrors(name: str, own: MaterialSpec | None) -> MaterialSpec | None:
    if isinstance(own, Mirror) or (own is None and name == "mirror"):
        return STONE
    if isinstance(own, Glass):
        return replace(own, eta=1.0)
    return Glass(eta=1.0) if own is None and name == "pane" else own


def _without_coat(name: str, own: MaterialSpec | None) -> MaterialSpec | None:
    if isinstance(own, Polished):
        kept = {each.name: getattr(own, each.name) for each in fields(Matt) if each.name != "kind"}
        return Matt(**kept)
    return COATED_FINISHES.get(name) if own is None else own


def _textured(name: str, own: MaterialSpec | None) -> MaterialSpec | None:
    if isinstance(own, Matt | Polished) and (own.contrast < FAINT or own.pattern == "plain"):
        return replace(own, pattern="poster", contrast=STRONG, tile_m=2.0, albedo=min(own.albedo, 0.55))
    return Matt("poster", 0.55, contrast=STRONG, tile_m=2.0) if own is None and name in FAINT_FINISHES else own


def _first_level(level: LevelSpec) -> LevelSpec:
    """As a light is at first, where it dims or is switched; its mean, where it flickers."""
    if level.flicker:
        return STEADY
    at_first = level.build().mean(0, 0)
    return LevelSpec(steady=at_first or 1.0)


def _still_lights(case: Case) -> Case:
    """Lamps that neither flicker nor dim, and a sun that stands."""

    def steady(light: Any) -> Any:
        return replace(light, level=_first_level(light.level)) if light and light.level else light

    scene = case.scene
    overrides = {name: steady(override) for name, override in case.lighting.items()}
    sun = steady(scene.sun)
    if sun and sun.path:
        key = sun.path[0]
        sun = replace(sun, path=(), azimuth_deg=key.azimuth_deg, elevation_deg=key.elevation_deg)
    lamps = tuple(map(steady, scene.lamps))
    return replace(case, scene=replace(scene, lamps=lamps, sun=sun, sky=steady(scene.sky)), lighting=overrides)


CEILING_SHARE = 0.96  # of a room's sides: a panel that throws no shadow to speak of
LOWER_M = 0.02


def _shadowless(case: Case) -> Case:
    """All lamps as one panel under the whole ceiling, and the sun's light as a sky that is bright alike everywhere.

    Its level over time is that of the strongest lamp.
    """
    scene = case.scene
    lighting = dict(case.lighting)
    if scene.room and scene.lamps:
        overrides = [lighting.pop(lamp.name, LightOverride()) for lamp in scene.lamps]
        powers = [
            lamp.power_lm if override.power_lm is None else override.power_lm
            for lamp, override in zip(scene.lamps, overrides, strict=True)
        ]
        strongest = int(np.argmax(powers))
        x, y, height = scene.room.size_m
        panel = PanelLamp(
            name=scene.lamps[strongest].name,
            center_m=(0.0, 0.0, height - LOWER_M),
            size_m=(CEILING_SHARE * x, CEILING_SHARE * y),
            power_lm=float(sum(powers)),
            colour=scene.lamps[strongest].colour,
            level=overrides[strongest].level or scene.lamps[strongest].level,
        )
        scene = replace(scene, lamps=(panel,))
    if scene.sun:
        override = lighting.pop("sun", LightOverride())
        below = scene.sky.illuminance_lx if scene.sky else 0.0
        lux = scene.sun.illuminance_lx if override.illuminance_lx is None else override.illuminance_lx
        scene = replace(scene, sun=None, sky=SkySpec(illuminance_lx=lux + below, kind="uniform"))
    return replace(case, scene=scene, lighting=lighting)


HEADROOM = 8.0
KNEE = 0.9  # of the grey values, for what fitted before; the rest is for what burned


def _unburnt(case: Case) -> Case:
    """A chip with eight times the full well: what was in its range looks nearly as before, the rest fits above.

    A fixed exposure that makes white more than white comes down to it first.
    """
    camera = case.camera
    chip = case.camera.chip
    stored = np.linspace(0, 1, FULL_SCALE_DN + 1)
    signal = np.interp(stored / KNEE, stored, linear_of_grey(chip.curve))
    above = stored > KNEE
    signal[above] = np.linspace(1, HEADROOM, 1 + int(above.sum()))[1:]
    wide = replace(
        chip,
        full_well_e=chip.full_well_e * HEADROOM,
        black_dn=chip.black_dn / HEADROOM,
        adc_bits=None,
        response=tuple(signal.tolist()),
    )
    loop = camera.auto_exposure
    loop = replace(loop, target_share=loop.target_share / HEADROOM) if loop else None
    probe = replace(camera, chip=wide, exposure_gain=1.0, auto_exposure=loop)
    most = camera.exposure_gain if loop else min(camera.exposure_gain, 10 ** (-camera.gain_db / 20))
    exposed = replace(camera, exposure_gain=most)
    return replace(case, camera=replace(probe, exposure_gain=exposed.white_e / probe.white_e))


def _noiseless(case: Case) -> Case:
    chip = case.camera.chip
    kept = {name: getattr(chip, name) for name in ("full_well_e", "black_dn", "response")}
    return replace(case, camera=replace(case.camera, chip=CameraSensor(**kept)))


def _lens_blur(case: Case) -> Case:
    return _camera(motion_blur=False, blur_sigma_px=0.0, defocus_px=0.0)(case)


NUISANCES = (
    Nuisance("mirrors", "matt stone, and panes that mirror nothing", _of_materials(_matt_mirrors), shown_by="mirror"),
    Nuisance("gloss", "matt surfaces", _of_materials(_without_coat), shown_by="gloss"),
    Nuisance("shadows", "light from the whole ceiling or sky", _shadowless, shown_by="shadow_edge"),
    Nuisance("changing light", "lamps and a sun that stay as they are", _still_lights),
    Nuisance("moving things", "a world at rest", _of_scene(lambda scene: replace(scene, movers=())), "moving"),
    Nuisance("low texture", "strong patterns on faint surfaces", _of_materials(_textured)),
    Nuisance("burnt pixels", "no more light than white needs, and eight times the range", _unburnt, shown_by="burnt"),
    Nuisance("blur", "a short exposure and a sharp lens", _lens_blur),
    Nuisance("noise", "a chip without noise", _noiseless),
    Nuisance("unlike eyes", "two equal eyes", _camera(unlike=Eyes())),
    Nuisance("dropped frames", "every frame, once", _timed(drop_share=0.0, repeat_share=0.0)),
    Nuisance("late pictures", "both taken at their stamp", _timed(jitter_ms=0.0, right_delay_ms=0.0)),
    Nuisance("late IMU", "readings stamped when they are taken", _timed(imu_delay_ms=0.0)),
    Nuisance("rolling shutter", "a global shutter", _camera(shutter="global", readout_ms=None)),
    Nuisance("auto-exposure", "the first exposure throughout", _camera(auto_exposure=None)),
    Nuisance("vignetting and dirt", "an even, clean lens", _camera(vignetting=0, vignetting_cutoff_deg=None, dirt=0)),
    Nuisance("flare", "a lens that scatters nothing", _camera(flare=0, ghost=0)),
    Nuisance("JPEG", "pictures without loss", _camera(jpeg_quality=None)),
    Nuisance(
        "calibration",
        "a calibration that is true",
        lambda case: replace(case, rig=replace(case.rig, calibration_error=CalibrationError())),
    ),
)
