"""The nuisances that make a case difficult, and for each of them, the change of settings that removes it."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from vobench.analysis.retiming import at_half_speed, at_half_turn_rate, at_twice_the_rate
from vobench.errors import VobenchError
from vobench.geometry.rig import CalibrationError
from vobench.motion.wander import Wander
from vobench.motion.wheeled import Wheeled
from vobench.runner.motion import body_motion, require_possible
from vobench.sensor.image_sensor import CameraDifference, CameraDifferences, CameraSensor
from vobench.sensor.imu import FLAWLESS
from vobench.sensor.response import FULL_SCALE_DN, linear_of_grey
from vobench.suite.case import Case
from vobench.suite.floor_finish import FLOOR
from vobench.suite.scene_check import materials_used
from vobench.suite.scene_entry import generated_scene
from vobench.suite.scene_spec import (
    STEADY,
    DiffuseSpec,
    GlassSpec,
    LevelSpec,
    LightOverride,
    MaterialSpec,
    MirrorSpec,
    PanelLamp,
    PolishedSpec,
    SceneFile,
    SkySpec,
)

MIN_TURN_DEG = 1.0  # between two frames: slower turns are not tried at half the rate
MIN_SHOWN_SHARE = 2e-3  # the smallest share of the pixels of a frame that must show a nuisance

Change = Callable[[Case], Case]


@dataclass(frozen=True, slots=True)
class Nuisance:
    """One of NUISANCES: its name, the change that removes it, and a description of what replaces it.

    A case does not have the nuisance if the change has no effect on the case, or if the condition `shown_by` does not
    exceed `shown_above` in any of its frames. A circumstance, such as speed, is changed by itself: it is not among
    the nuisances that are removed together. `needs` are sensors without which an estimator does not notice it, and
    `spoils` those that the change takes away. `parts` are what it consists of: if it is the cause, they are removed one
    at a time.
    """

    name: str
    instead: str
    remove: Change
    shown_by: str | None = None
    shown_above: float = MIN_SHOWN_SHARE
    is_circumstance: bool = False
    needs: frozenset[str] = frozenset()
    spoils: frozenset[str] = frozenset()
    parts: tuple["Nuisance", ...] = ()

    def parts_of(self, case: Case) -> tuple["Nuisance", ...]:
        """The parts that a case has; empty unless there are several."""
        present = tuple(part for part in self.parts if _is_possible(part, case))
        return present if len(present) > 1 else ()


def nuisances_of(
    case: Case,
    largest: Mapping[str, float] = MappingProxyType({}),
    sensors: Iterable[str] | None = None,
) -> tuple[Nuisance, ...]:
    """The NUISANCES that a case has and that a change can remove.

    `largest` are the largest values of the known conditions. `sensors` are those that the estimator needs; None stands
    for all.
    """
    present = []
    for nuisance in NUISANCES:
        is_shown = largest.get(nuisance.shown_by or "", np.inf) > nuisance.shown_above
        if is_shown and _concerns(nuisance, sensors) and _is_possible(nuisance, case):
            present.append(nuisance)
    return tuple(present)


def _concerns(nuisance: Nuisance, sensors: Iterable[str] | None) -> bool:
    """Whether an estimator with these sensors notices a nuisance, and still has its sensors without it."""
    if sensors is None:
        return True
    used = set(sensors)
    return nuisance.needs <= used and not nuisance.spoils & used


def _is_possible(nuisance: Nuisance, case: Case) -> bool:
    """Whether a change has an effect on a case, and leaves one that can be simulated."""
    try:
        changed = nuisance.remove(case)
        if changed == case:
            return False
        if nuisance.is_circumstance:
            require_possible(changed, body_motion(changed))
    except VobenchError:
        return False
    return True


def without(case: Case, removed: Iterable[str]) -> Case:
    """The case without these nuisances, which are removed in the order of NUISANCES."""
    names = set(removed)
    for nuisance in NUISANCES:
        for each in (nuisance, *nuisance.parts):
            if each.name in names:
                case = each.remove(case)
    return case


def nuisance_named(name: str) -> Nuisance:
    """The nuisance with a name, or the part of one."""
    every = [each for nuisance in NUISANCES for each in (nuisance, *nuisance.parts)]
    return next(each for each in every if each.name == name)


# --- Settings of the camera and its timing ---


def _with_camera(**settings: Any) -> Change:
    """A change of some settings of the camera."""
    return lambda case: replace(case, camera=replace(case.camera, **settings))


def _with_equal_brightness(case: Case) -> Case:
    """Give the chips of both cameras the same light."""
    unlike = case.camera.unlike
    equal = CameraDifferences(left=replace(unlike.left, gain=1.0), right=replace(unlike.right, gain=1.0))
    return replace(case, camera=replace(case.camera, unlike=equal))


def _with_equal_lenses(case: Case) -> Case:
    """Give both cameras the lens of the settings, with their own brightness."""
    unlike = case.camera.unlike
    equal = CameraDifferences(
        left=CameraDifference(gain=unlike.left.gain), right=CameraDifference(gain=unlike.right.gain)
    )
    return replace(case, camera=replace(case.camera, unlike=equal))


def _with_timing(**settings: Any) -> Change:
    """A change of some settings of the camera's timing."""

    def change(case: Case) -> Case:
        timing = replace(case.camera.timing, **settings)
        return replace(case, camera=replace(case.camera, timing=timing))

    return change


def _without_blur(case: Case) -> Case:
    return _with_camera(motion_blur=False, blur_sigma_px=0.0, defocus_px=0.0)(case)


def _without_noise(case: Case) -> Case:
    chip = case.camera.chip
    noiseless = CameraSensor(full_well_e=chip.full_well_e, black_dn=chip.black_dn, response=chip.response)
    return replace(case, camera=replace(case.camera, chip=noiseless))


HEADROOM = 8.0  # the full well of the new chip, relative to that of the original
KNEE = 0.9  # the share of the grey values for signals that were in range before


def _without_saturation(case: Case) -> Case:
    """Give the chip eight times the full well.

    Signals that were in range look nearly as before, and brighter signals are not saturated. A fixed exposure that
    saturates white is reduced first, so that white is just not saturated.
    """
    camera = case.camera
    chip = camera.chip
    grey = np.linspace(0, 1, FULL_SCALE_DN + 1)
    signal = np.interp(grey / KNEE, grey, linear_of_grey(chip.curve))  # relative to the full well of the original chip
    is_above = grey > KNEE
    signal[is_above] = np.linspace(1, HEADROOM, 1 + int(is_above.sum()))[1:]
    wide_chip = replace(
        chip,
        full_well_e=chip.full_well_e * HEADROOM,
        black_dn=chip.black_dn / HEADROOM,
        adc_bits=None,
        response=tuple(signal.tolist()),
    )

    loop = camera.auto_exposure
    if loop:
        loop = replace(loop, target_share=loop.target_share / HEADROOM)
        exposure_gain = camera.exposure_gain
    else:
        gain_of_white = 10 ** (-camera.gain_db / 20) / camera.compensation
        exposure_gain = min(camera.exposure_gain, gain_of_white)

    white_e = replace(camera, exposure_gain=exposure_gain).white_e
    wide = replace(camera, chip=wide_chip, exposure_gain=1.0, auto_exposure=loop)
    return replace(case, camera=replace(wide, exposure_gain=white_e / wide.white_e))


def _with_true_calibration(case: Case) -> Case:
    return replace(case, rig=replace(case.rig, calibration_error=CalibrationError()))


LIGHT_FACTOR = 4.0
DARK_DN = 80.0  # pictures with a smaller mean grey value are dark


def _with_more_light(case: Case) -> Case:
    """Four times the light. The exposure time and the gain are as before, or follow from the light by auto-exposure.

    The aperture stands for the light: exposed photons are proportional to both.
    """
    camera = case.camera
    return replace(case, camera=replace(camera, exposure_gain=LIGHT_FACTOR * camera.exposure_gain))


def _with_exact_imu(case: Case) -> Case:
    """The IMU without noise, bias, scale and misalignment."""
    imu = case.rig.imu
    if imu is None:
        return case
    return replace(case, rig=replace(case.rig, imu=replace(imu, gyro=FLAWLESS, accel=FLAWLESS)))


def _without_slip(case: Case) -> Case:
    """A floor on which no wheel slips."""
    trajectory = case.trajectory
    if not isinstance(trajectory, Wheeled) or trajectory.mover != "pioneer":
        return case
    return replace(case, trajectory=replace(trajectory, slip="none", floor=()))


def _with_exact_encoders(case: Case) -> Case:
    """Wheels of exactly their nominal size."""
    trajectory = case.trajectory
    if not isinstance(trajectory, Wheeled | Wander):
        return case
    return replace(case, trajectory=replace(trajectory, encoders="exact"))


def _with_twice_the_baseline(case: Case) -> Case:
    """Cameras that are twice as far apart."""
    return replace(case, rig=replace(case.rig, baseline_m=2 * case.rig.build().baseline_m))


def _in_another_place(case: Case) -> Case:
    """The place that the generator of the scene creates from the next seed, in the same lighting.

    Only a trajectory that finds its way through a place can be driven in another one.
    """
    generated = case.scene.generated
    if generated is None or not isinstance(case.trajectory, Wander):
        return case
    scene = generated_scene(case.scene, generated.seed + 1, generated.lighting)
    return replace(case, scene=scene, variant={**case.variant, "scene": scene.place_name})


# --- Materials and moving objects ---

MaterialChange = Callable[[str, MaterialSpec | None], MaterialSpec | None]


def _without_movers(case: Case) -> Case:
    return replace(case, scene=replace(case.scene, movers=()))


def _without_fog(case: Case) -> Case:
    return replace(case, scene=replace(case.scene, fog=None))


def _without_rain(case: Case) -> Case:
    return replace(case, scene=replace(case.scene, rain=None))


def _without_wind(case: Case) -> Case:
    return replace(case, scene=replace(case.scene, wind=None))


def _with_materials(change: MaterialChange) -> Change:
    """A change of every material that a scene uses.

    `change` is called with the name and the definition in the scene, which is None for a built-in finish.
    """

    def changed(case: Case) -> Case:
        scene = case.scene
        materials = dict(scene.materials)
        used = {name for _, name in materials_used(scene)} | set(materials)
        for name in sorted(used):
            defined = scene.materials.get(name)
            replacement = change(name, defined)
            if replacement is not None and replacement != defined:
                materials[name] = replacement
        floor = scene.floor and change(FLOOR, scene.floor)
        return replace(case, scene=replace(scene, materials=materials, floor=floor))

    return changed


# Mirrors are replaced by textured stone, because a plain surface would add the nuisance of low texture.
STONE = DiffuseSpec("terrazzo", 0.45, contrast=0.5)
# Built-in finishes with a glossy coat, and those with little texture; the others are textured by a picture.
COATED_FINISHES = {"terrazzo": DiffuseSpec("terrazzo", 0.45, contrast=0.4)}
FAINT_FINISHES = ("white_plaster", "sage_plaster", "paint")
FAINT_CONTRAST = 0.3
STRONG_CONTRAST = 0.7
STRONG_TILE_M = 2.0
STRONG_ALBEDO = 0.55  # at most: a brighter pattern of this contrast would be clipped


def _diffuse_mirror(name: str, defined: MaterialSpec | None) -> MaterialSpec | None:
    """Stone instead of a mirror, and a pane without reflections."""
    if isinstance(defined, MirrorSpec):
        return STONE
    if isinstance(defined, GlassSpec):
        return replace(defined, eta=1.0)
    if defined is None and name == "mirror":
        return STONE
    if defined is None and name == "pane":
        return GlassSpec(eta=1.0)
    return defined


def _without_coat(name: str, defined: MaterialSpec | None) -> MaterialSpec | None:
    """The diffuse material below a glossy coat."""
    if defined is None:
        return COATED_FINISHES.get(name)
    if isinstance(defined, PolishedSpec):
        names = [field.name for field in fields(DiffuseSpec) if field.name != "kind"]
        return DiffuseSpec(**{name: getattr(defined, name) for name in names})
    return defined


def _with_strong_texture(name: str, defined: MaterialSpec | None) -> MaterialSpec | None:
    """A pattern with strong contrast instead of a plain or faint one."""
    if defined is None and name in FAINT_FINISHES:
        return DiffuseSpec("poster", STRONG_ALBEDO, contrast=STRONG_CONTRAST, tile_m=STRONG_TILE_M)
    if not isinstance(defined, DiffuseSpec | PolishedSpec):
        return defined
    if defined.contrast < FAINT_CONTRAST or defined.pattern == "plain":
        albedo = min(defined.albedo, STRONG_ALBEDO)
        return replace(defined, pattern="poster", contrast=STRONG_CONTRAST, tile_m=STRONG_TILE_M, albedo=albedo)
    return defined


def _with_texture(case: Case) -> Case:
    """Strong patterns on plain and faint surfaces, and no paint over any."""
    bare = replace(case, scene=replace(case.scene, paint=None))
    return _with_materials(_with_strong_texture)(bare)


# --- Light ---


def _with_steady_light(case: Case) -> Case:
    """Keep lamps from flickering and dimming, and the sun from moving."""
    scene = case.scene
    overrides = {name: _steady(override) for name, override in case.lighting.items()}
    sun = _steady(scene.sun)
    if sun and sun.path:
        start = sun.path[0]
        sun = replace(sun, path=(), azimuth_deg=start.azimuth_deg, elevation_deg=start.elevation_deg)
    lamps = tuple(_steady(lamp) for lamp in scene.lamps)
    scene = replace(scene, lamps=lamps, sun=sun, sky=_steady(scene.sky))
    return replace(case, scene=scene, lighting=overrides)


def _steady(light: Any) -> Any:
    """A light, or an override of one, whose level does not change."""
    if light is None or light.level is None:
        return light
    return replace(light, level=_first_level(light.level))


def _first_level(level: LevelSpec) -> LevelSpec:
    """The level at the start of a light that dims or is switched; the mean of one that flickers."""
    if level.flicker:
        return STEADY
    at_start = level.build().mean(0, 0)
    return LevelSpec(steady=at_start or 1.0)


CEILING_SHARE = 0.96  # the size of the panel relative to the room; the shadows of such a large panel are negligible
PANEL_BELOW_CEILING_M = 0.02


def _without_shadows(case: Case) -> Case:
    """Replace lamps by one panel below the whole ceiling, and the sun by a uniform sky of the same illuminance.

    The level of the panel over time is that of the strongest lamp.
    """
    scene = case.scene
    lighting = dict(case.lighting)
    if scene.room and scene.lamps:
        overrides = [lighting.pop(lamp.name, LightOverride()) for lamp in scene.lamps]
        scene = replace(scene, lamps=(_ceiling_panel(scene, overrides),))

    if scene.sun:
        override = lighting.pop("sun", LightOverride())
        sun_lx = _overridden(scene.sun.illuminance_lx, override.illuminance_lx)
        sky_lx = scene.sky.illuminance_lx if scene.sky else 0.0
        panorama = scene.sky.panorama if scene.sky else None
        uniform_sky = SkySpec(illuminance_lx=sun_lx + sky_lx, kind="uniform", panorama=panorama)
        scene = replace(scene, sun=None, sky=uniform_sky)
    return replace(case, scene=scene, lighting=lighting)


def _ceiling_panel(scene: SceneFile, overrides: Sequence[LightOverride]) -> PanelLamp:
    """One panel with the power of all lamps of a room, given the override of each."""
    assert scene.room is not None
    lamps = zip(scene.lamps, overrides, strict=True)
    powers_lm = [_overridden(lamp.power_lm, override.power_lm) for lamp, override in lamps]
    index = int(np.argmax(powers_lm))
    strongest = scene.lamps[index]
    length_m, width_m, height_m = scene.room.size_m
    return PanelLamp(
        name=strongest.name,
        center_m=(0.0, 0.0, height_m - PANEL_BELOW_CEILING_M),
        size_m=(CEILING_SHARE * length_m, CEILING_SHARE * width_m),
        power_lm=float(sum(powers_lm)),
        colour=strongest.colour,
        level=overrides[index].level or strongest.level,
    )


def _overridden(nominal: float, override: float | None) -> float:
    return nominal if override is None else override


ENCODERS = frozenset({"encoders"})
IMU = frozenset({"imu"})
STEREO = frozenset({"stereo"})

NUISANCES = (
    Nuisance("mirrors", "diffuse stone, and panes without reflections", _with_materials(_diffuse_mirror), "mirror"),
    Nuisance("gloss", "diffuse surfaces", _with_materials(_without_coat), "gloss"),
    Nuisance("shadows", "light from the whole ceiling or sky", _without_shadows, "shadow_edge"),
    Nuisance("changing light", "steady lamps and sun", _with_steady_light),
    Nuisance("moving things", "a static scene", _without_movers, "moving"),
    Nuisance("fog", "clear air", _without_fog),
    Nuisance("rain", "dry air over dry ground", _without_rain),
    Nuisance("wind", "leaves that stand still", _without_wind),
    Nuisance("low texture", "strong patterns on faint surfaces", _with_texture),
    Nuisance(
        "low light",
        "four times the light, exposed as before",
        _with_more_light,
        "darkness",
        shown_above=1 / DARK_DN,
    ),
    Nuisance(
        "burnt pixels", "an exposure that just fits white, and eight times the range", _without_saturation, "burnt"
    ),
    Nuisance("blur", "a short exposure and a sharp lens", _without_blur),
    Nuisance("noise", "a chip without noise", _without_noise),
    Nuisance(
        "unlike eyes",
        "two equal cameras",
        _with_camera(unlike=CameraDifferences()),
        parts=(
            Nuisance("unlike brightness", "two equally bright cameras", _with_equal_brightness),
            Nuisance("unlike lenses", "two equally sharp and clean lenses", _with_equal_lenses),
        ),
    ),
    Nuisance("dropped frames", "every frame, once", _with_timing(drop_share=0.0, repeat_share=0.0)),
    Nuisance("late images", "both images taken at their time stamp", _with_timing(jitter_ms=0.0, right_delay_ms=0.0)),
    Nuisance("late IMU", "readings stamped when they are taken", _with_timing(imu_delay_ms=0.0)),
    Nuisance("rolling shutter", "a global shutter", _with_camera(shutter="global", readout_ms=None)),
    Nuisance("auto-exposure", "the first exposure throughout", _with_camera(auto_exposure=None)),
    Nuisance(
        "vignetting and dirt", "an even, clean lens", _with_camera(vignetting=0, vignetting_cutoff_deg=None, dirt=0)
    ),
    Nuisance("drops on the lens", "a dry lens", _with_camera(lens_drops=0.0)),
    Nuisance("flare", "a lens without stray light", _with_camera(flare=0, ghost=0)),
    Nuisance("JPEG", "lossless images", _with_camera(jpeg_quality=None)),
    Nuisance("calibration", "the true calibration", _with_true_calibration),
    Nuisance("IMU errors", "an exact IMU", _with_exact_imu, needs=IMU),
    Nuisance("wheel slip", "a floor without slip", _without_slip, needs=ENCODERS),
    Nuisance("encoder errors", "wheels of nominal size", _with_exact_encoders, needs=ENCODERS),
    Nuisance("speed", "the same path at half speed", at_half_speed, is_circumstance=True, spoils=ENCODERS),
    Nuisance(
        "fast turns",
        "the same path at half the turn rate",
        at_half_turn_rate,
        "turn",
        shown_above=MIN_TURN_DEG,
        is_circumstance=True,
        spoils=ENCODERS,
    ),
    Nuisance("low frame rate", "twice as many images", at_twice_the_rate, is_circumstance=True, spoils=ENCODERS),
    Nuisance("short baseline", "twice the baseline", _with_twice_the_baseline, is_circumstance=True, needs=STEREO),
    Nuisance("this place", "another place of the same generator", _in_another_place, is_circumstance=True),
)
