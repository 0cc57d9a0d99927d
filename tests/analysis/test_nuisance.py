"""Each change of a case removes its nuisance, and nothing else."""

from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from typing import Any

import numpy as np
import pytest

from vobench.analysis.conditions import conditions
from vobench.analysis.nuisance import COATED_FINISHES, FAINT_FINISHES, NUISANCES, nuisance_named, nuisances_of, without
from vobench.geometry import se3
from vobench.geometry.rig import looking
from vobench.motion.wander import Wander
from vobench.scene.fog import Fog
from vobench.scene.material import reflectance
from vobench.scene.paint import Paint
from vobench.scene.rain import Rain
from vobench.scene.wind import Wind
from vobench.sensor.image_sensor import CameraDifference, CameraDifferences, NoiseStreams, expose
from vobench.sensor.imu import FLAWLESS, IMUS
from vobench.sequence.reader import StereoFrame
from vobench.suite.case import Case
from vobench.suite.scene_build import build
from vobench.suite.scene_spec import (
    STEADY,
    BoxSpec,
    DiffuseSpec,
    GeneratedSpec,
    GlassSpec,
    LevelSpec,
    LightOverride,
    PolishedSpec,
    SceneFile,
    SkySpec,
    SunKey,
    SunSpec,
)
from vobench.trajectory.trajectory import Trajectory

BURNT = "burnt pixels"
LOW_LIGHT = "low light"  # more light than there is can always be had
REPEATABLE = (BURNT, LOW_LIGHT)
# What the fixtures do not have: an IMU, weather, a generator, and a case that can be simulated.
ABSENT = ("IMU errors", "fog", "rain", "wind")
REMOVABLE = [nuisance for nuisance in NUISANCES if not nuisance.is_circumstance and nuisance.name not in ABSENT]
NAMES = [nuisance.name for nuisance in REMOVABLE]


def changes(before: Any, after: Any, path: str = "") -> Iterator[tuple[str, Any]]:
    """The settings that differ, each with its value after the change."""
    if before == after:
        return
    if is_dataclass(before) and type(before) is type(after):
        for field in fields(before):
            yield from changes(getattr(before, field.name), getattr(after, field.name), f"{path}.{field.name}")
    elif isinstance(before, dict) and isinstance(after, dict):
        for key in {**before, **after}:
            yield from changes(before.get(key), after.get(key), f"{path}.{key}")
    else:
        yield path.lstrip("."), after


def removable(case: Case) -> list[str]:
    """The nuisances of a case that are no circumstances."""
    return [nuisance.name for nuisance in nuisances_of(case) if not nuisance.is_circumstance]


def with_camera(case: Case, **settings: Any) -> Case:
    return replace(case, camera=replace(case.camera, **settings))


@pytest.fixture
def worst(hard: Case) -> Case:
    """The case that has some of everything, with even more wrong in its camera."""
    timing = replace(hard.camera.timing, repeat_share=0.1, right_delay_ms=2.0)
    return with_camera(
        hard,
        blur_sigma_px=0.5,
        defocus_px=1.0,
        vignetting_cutoff_deg=50.0,
        ghost=0.1,
        unlike=CameraDifferences(left=CameraDifference(gain=0.9), right=CameraDifference(gain=0.5)),
        timing=timing,
    )


CAMERA_CHANGES = {
    "blur": {"camera.motion_blur": False, "camera.blur_sigma_px": 0.0, "camera.defocus_px": 0.0},
    "noise": {
        "camera.chip.shot_noise": False,
        "camera.chip.read_noise_e": 0.0,
        "camera.chip.prnu": 0.0,
        "camera.chip.dsnu_e": 0.0,
        "camera.chip.column_e": 0.0,
        "camera.chip.dark_e_per_s": 0.0,
        "camera.chip.adc_bits": None,
    },
    "unlike eyes": {"camera.unlike.left.gain": 1.0, "camera.unlike.right.gain": 1.0},
    "dropped frames": {"camera.timing.drop_share": 0.0, "camera.timing.repeat_share": 0.0},
    "late images": {"camera.timing.jitter_ms": 0.0, "camera.timing.right_delay_ms": 0.0},
    "late IMU": {"camera.timing.imu_delay_ms": 0.0},
    "rolling shutter": {"camera.shutter": "global", "camera.readout_ms": None},
    "auto-exposure": {"camera.auto_exposure": None},
    "vignetting and dirt": {"camera.vignetting": 0, "camera.vignetting_cutoff_deg": None, "camera.dirt": 0},
    "drops on the lens": {"camera.lens_drops": 0.0},
    "flare": {"camera.flare": 0, "camera.ghost": 0},
    "JPEG": {"camera.jpeg_quality": None},
    "calibration": {"rig.calibration_error.right_yaw_deg": 0.0},
    "moving things": {"scene.movers": ()},
}


@pytest.mark.parametrize("name", CAMERA_CHANGES)
def test_a_removal_sets_exactly_the_settings_of_its_nuisance(worst: Case, name: str) -> None:
    assert dict(changes(worst, without(worst, [name]))) == CAMERA_CHANGES[name]


def unlike_eyes(case: Case, **differences: CameraDifference) -> Case:
    return with_camera(case, unlike=CameraDifferences(**differences))


def test_the_parts_of_unlike_eyes_are_brightness_and_lenses(hard: Case) -> None:
    case = unlike_eyes(hard, left=CameraDifference(gain=0.9), right=CameraDifference(gain=0.5, blur_sigma_px=2.0))
    parts = nuisance_named("unlike eyes").parts_of(case)
    assert [part.name for part in parts] == ["unlike brightness", "unlike lenses"]
    assert dict(changes(case, without(case, ["unlike brightness"]))) == CAMERA_CHANGES["unlike eyes"]
    assert dict(changes(case, without(case, ["unlike lenses"]))) == {"camera.unlike.right.blur_sigma_px": None}
    both = without(case, ["unlike brightness", "unlike lenses"])
    assert both == without(case, ["unlike eyes"])


def test_a_case_with_one_part_has_no_parts(hard: Case) -> None:
    eyes = nuisance_named("unlike eyes")
    assert eyes.parts_of(unlike_eyes(hard, right=CameraDifference(gain=0.5))) == ()
    assert eyes.parts_of(unlike_eyes(hard, right=CameraDifference(dirt=0.1))) == ()
    assert nuisance_named("noise").parts_of(hard) == ()


@pytest.mark.parametrize("name", NAMES)
def test_a_removal_removes_its_nuisance_and_leaves_all_others(hard: Case, name: str) -> None:
    assert removable(without(hard, [name])) == [other for other in NAMES if other != name or name in REPEATABLE]


@pytest.mark.parametrize("name", ["fog", "rain", "wind"])
def test_weather_is_removed_from_the_scene(hard: Case, name: str) -> None:
    weather = {"fog": Fog(visibility_m=20.0), "rain": Rain(rate_mm_per_h=5.0), "wind": Wind()}[name]
    foul = replace(hard, scene=replace(hard.scene, **{name: weather}))
    assert removable(foul).count(name) == 1
    assert dict(changes(foul, without(foul, [name]))) == {f"scene.{name}": None}
    assert name not in removable(hard)


# --- What the frames show ---


def shown(case: Case) -> dict[str, float]:
    """The conditions of a frame from a corner of the hall, which has the mirror, the floor and the cart in view."""
    T_world_left = se3.transform(se3.rotation_z(0.3), (-1.5, -0.8, 1.2)) @ looking(pitch_deg=20, position_m=(0, 0, 0))
    image = np.full((4, 4), 128, np.uint8)
    found = conditions(case, Trajectory(np.array([0]), T_world_left[None]), [StereoFrame(0, 0, image, image)], {})
    return {name: float(values[0]) for name, values in found.items()}


OF_SCENE = ("mirror", "gloss", "moving", "faintness", "shadow_edge")


@pytest.mark.parametrize(
    ("name", "condition", "also_changed"),
    [
        ("mirrors", "mirror", {"faintness"}),  # stone has a texture, a mirror has none
        ("gloss", "gloss", set()),
        ("moving things", "moving", {"shadow_edge", "gloss", "faintness"}),  # the cart hides and shades what is behind
    ],
)
def test_frames_no_longer_show_what_was_removed_and_show_the_rest_as_before(
    hard, name, condition, also_changed
) -> None:
    before = shown(hard)
    after = shown(without(hard, [name]))
    assert before[condition] > 0.003
    assert after[condition] == 0
    for other in set(OF_SCENE) - {condition} - also_changed:
        assert after[other] == pytest.approx(before[other], rel=1e-6), other


def test_without_shadows_there_are_few_edges_and_without_low_texture_nothing_is_faint(hard: Case) -> None:
    before = shown(hard)
    shadowless, textured = (shown(without(hard, [name])) for name in ("shadows", "low texture"))
    assert shadowless["shadow_edge"] < 0.6 * before["shadow_edge"]  # edges at the sides of objects stay
    assert shadowless["faintness"] == pytest.approx(before["faintness"])
    assert textured["faintness"] < 0.75 * before["faintness"]
    assert textured["shadow_edge"] == pytest.approx(before["shadow_edge"])


# --- Materials ---


def test_mirrors_become_stone_that_is_neither_faint_nor_glossy_and_panes_stop_mirroring(hard: Case) -> None:
    materials = {**hard.scene.materials, "door": GlassSpec(eta=1.5)}
    case = replace(hard, scene=replace(hard.scene, materials=materials))
    changed = without(case, ["mirrors"]).scene.materials
    assert changed["door"] == GlassSpec(eta=1.0)
    stone = changed["glass"]
    assert isinstance(stone, DiffuseSpec)
    assert 0.2 < float(reflectance(stone.build()).mean()) < 0.7
    assert without(case, ["mirrors", "low texture"]).scene.materials["glass"] == stone
    assert changed["floor"] == hard.scene.materials["floor"]


def finished(case: Case, finish: str) -> Case:
    """The case with one box more, of a built-in finish."""
    box = BoxSpec(name="more", center_m=(-1, 1, 0.2), size_m=(0.3, 0.3, 0.3), material=finish)
    return replace(case, scene=replace(case.scene, boxes=(*case.scene.boxes, box)))


def test_built_in_mirrors_and_panes_are_replaced_as_those_of_the_scene(hard: Case) -> None:
    stone = without(hard, ["mirrors"]).scene.materials["glass"]
    assert without(finished(hard, "mirror"), ["mirrors"]).scene.materials["mirror"] == stone
    assert without(finished(hard, "pane"), ["mirrors"]).scene.materials["pane"] == GlassSpec(eta=1.0)
    assert "brick" not in without(finished(hard, "brick"), NAMES).scene.materials


@pytest.mark.parametrize("finish", COATED_FINISHES)
def test_a_built_in_coat_is_taken_off_and_what_is_below_is_about_as_bright(hard: Case, finish: str) -> None:
    case = finished(hard, finish)
    coated = build(case.scene, {}).materials[finish]
    below = without(case, ["gloss"]).scene.materials[finish].build()
    assert coated.is_coated
    assert not below.is_coated
    assert float(reflectance(below).mean()) == pytest.approx(float(reflectance(coated).mean()), rel=0.35)


def test_the_floor_that_a_scene_replaces_loses_its_coat_and_paint_comes_off(hard: Case) -> None:
    marble = PolishedSpec("terrazzo", 0.4, contrast=0.5)
    scene = replace(hard.scene, floor=marble, paint=Paint(cover=0.9))
    case = replace(hard, scene=scene)
    dull = without(case, ["gloss"]).scene
    assert dull.floor == DiffuseSpec("terrazzo", 0.4, contrast=0.5)
    assert dull.paint == scene.paint
    textured = without(case, ["low texture"]).scene
    assert textured.paint is None
    assert textured.floor == marble
    assert without(hard, ["gloss", "low texture"]).scene.floor is None


def contrast(material: Any) -> float:
    pixels = np.asarray(material.build().texture.pixels(), float)
    return float(pixels.std() / pixels.mean())


@pytest.mark.parametrize("finish", FAINT_FINISHES)
def test_faint_finishes_get_a_pattern_of_strong_contrast(hard: Case, finish: str) -> None:
    replaced = without(finished(hard, finish), ["low texture"]).scene.materials[finish]
    assert contrast(replaced) > 0.3
    assert 0.2 < float(reflectance(replaced.build()).mean()) < 0.7
    assert replaced == without(hard, ["low texture"]).scene.materials["white_plaster"]


def test_only_faint_and_plain_materials_get_a_pattern_and_they_are_at_most_as_bright_as_it_can_be(hard: Case) -> None:
    bright = DiffuseSpec("terrazzo", 0.9, contrast=0.29, resolution_px=8)
    dark = DiffuseSpec("plain", 0.2, contrast=0.5, resolution_px=8)
    clear = DiffuseSpec("terrazzo", 0.9, contrast=0.3, resolution_px=8)
    materials = {**hard.scene.materials, "bright": bright, "dark": dark, "clear": clear}
    changed = without(replace(hard, scene=replace(hard.scene, materials=materials)), ["low texture"]).scene.materials
    assert changed["clear"] == clear
    assert changed["dark"] == replace(dark, pattern="poster", contrast=0.7, tile_m=2.0)
    assert changed["bright"] == replace(bright, pattern="poster", contrast=0.7, tile_m=2.0, albedo=0.55)
    assert contrast(replace(changed["bright"], resolution_px=256)) > 0.3


# --- Light ---


def with_sun(case: Case, **settings: Any) -> Case:
    sun = SunSpec(illuminance_lx=5000.0, azimuth_deg=10.0, elevation_deg=40.0)
    sky = SkySpec(illuminance_lx=1000.0, kind="overcast")
    return replace(case, scene=replace(case.scene, sun=replace(sun, **settings), sky=sky))


def test_a_moving_sun_stands_where_it_was_at_first(hard: Case) -> None:
    path = (SunKey(t_s=0, azimuth_deg=20.0, elevation_deg=30.0), SunKey(t_s=9, azimuth_deg=60.0, elevation_deg=50.0))
    moving = with_sun(hard, azimuth_deg=None, elevation_deg=None, path=path)
    sun = without(moving, ["changing light"]).scene.sun
    assert (sun.path, sun.azimuth_deg, sun.elevation_deg) == ((), 20.0, 30.0)


@pytest.mark.parametrize(
    ("level", "expected"),
    [
        (LevelSpec(dimmer=((0, 0.6), (1, 0.1))), 0.6),
        (LevelSpec(dimmer=((0, 0.0), (1, 0.5))), 1.0),  # a light that is off at first would be no light at all
        (LevelSpec(steady=0.4), 0.4),
    ],
)
def test_lights_keep_the_level_of_the_start(hard: Case, level: LevelSpec, expected: float) -> None:
    case = with_sun(hard, level=level)
    case = replace(case, lighting={"lamp": LightOverride(power_lm=200.0, level=level)})
    changed = without(case, ["changing light"])
    assert changed.scene.sun.level == LevelSpec(steady=expected)
    assert changed.lighting == {"lamp": LightOverride(power_lm=200.0, level=LevelSpec(steady=expected))}


def test_flicker_becomes_its_mean_and_a_light_without_an_override_of_its_level_has_none(hard: Case) -> None:
    case = replace(hard, lighting={"spot": LightOverride(power_lm=50.0)})
    changed = without(case, ["changing light"])
    assert {lamp.name: lamp.level for lamp in changed.scene.lamps} == {"lamp": STEADY, "spot": STEADY}
    assert changed.lighting == case.lighting


def test_the_shadowless_panel_covers_nearly_the_whole_ceiling_just_below_it(hard: Case) -> None:
    (panel,) = without(hard, ["shadows"]).scene.lamps
    assert panel.center_m[:2] == (0, 0)
    assert 2.4 < panel.center_m[2] < 2.5
    assert 0.9 * 4 < panel.size_m[0] == panel.size_m[1] < 4


def test_the_sun_becomes_a_uniform_sky_of_the_illuminance_of_both(hard: Case) -> None:
    changed = without(with_sun(hard), ["shadows"])
    assert changed.scene.sun is None
    assert changed.scene.sky == SkySpec(illuminance_lx=6000.0, kind="uniform")
    dimmed = replace(with_sun(hard), lighting={"sun": LightOverride(illuminance_lx=300.0)})
    changed = without(dimmed, ["shadows"])
    assert changed.scene.sky.illuminance_lx == 1300
    assert not changed.lighting
    alone = replace(hard, scene=replace(with_sun(hard).scene, sky=None))
    assert without(alone, ["shadows"]).scene.sky.illuminance_lx == 5000


# --- All nuisances ---


def test_a_case_with_everything_has_every_nuisance_and_without_them_none_but_its_range(hard: Case) -> None:
    names = removable(hard)
    assert names == NAMES
    assert removable(without(hard, names)) == [LOW_LIGHT, BURNT]


def test_what_removals_make_can_be_built_and_in_any_order_is_the_same(hard: Case) -> None:
    for name in NAMES:
        without(hard, [name]).build_scene()
    assert without(hard, NAMES) == without(hard, NAMES[::-1])


def test_a_removal_leaves_the_way_and_the_seed(hard: Case) -> None:
    for nuisance in REMOVABLE:
        if nuisance.name in ("wheel slip", "encoder errors"):
            continue
        changed = nuisance.remove(hard)
        assert (changed.trajectory, changed.seed, changed.name) == (hard.trajectory, hard.seed, hard.name)


def test_what_is_not_seen_in_any_frame_is_not_removed(hard: Case) -> None:
    kept = {nuisance.name for nuisance in nuisances_of(hard, {"mirror": 0.002, "moving": 0.003})}
    assert kept & set(NAMES) == set(NAMES) - {"mirrors"}
    for darkest_dn, is_dark in ((79, True), (81, False)):
        names = {nuisance.name for nuisance in nuisances_of(hard, {"darkness": 1 / darkest_dn})}
        assert (LOW_LIGHT in names) == is_dark


# --- Light, wheels, inertia and circumstances ---


@pytest.fixture
def possible(hard: Case) -> Case:
    """The case without the delay of an IMU that it has not got, so that it can be simulated."""
    return with_camera(hard, timing=replace(hard.camera.timing, imu_delay_ms=0.0))


def test_more_light_is_four_times_the_photons_at_the_same_exposure(hard: Case) -> None:
    brighter = without(hard, [LOW_LIGHT])
    assert dict(changes(hard, brighter)) == {"camera.exposure_gain": 4 * hard.camera.exposure_gain}
    assert brighter.camera.white_e == pytest.approx(4 * hard.camera.white_e)


def test_wheels_neither_slip_nor_differ_from_their_nominal_size(hard: Case) -> None:
    assert dict(changes(hard, without(hard, ["wheel slip"]))) == {"trajectory.slip": "none"}
    assert dict(changes(hard, without(hard, ["encoder errors"]))) == {"trajectory.encoders": "exact"}


def test_an_exact_imu_stays_where_it_is(hard: Case) -> None:
    imu = replace(IMUS["mpu6000"], position_m=(0.1, 0.0, 0.2)) if "mpu6000" in IMUS else next(iter(IMUS.values()))
    case = replace(hard, rig=replace(hard.rig, imu=imu))
    exact = without(case, ["IMU errors"]).rig.imu
    assert exact is not None
    assert (exact.gyro, exact.accel) == (FLAWLESS, FLAWLESS)
    assert (exact.rate_hz, exact.position_m) == (imu.rate_hz, imu.position_m)
    assert without(hard, ["IMU errors"]) == hard


def test_circumstances_are_offered_where_the_changed_case_can_be_simulated(possible: Case) -> None:
    names = {nuisance.name for nuisance in nuisances_of(possible) if nuisance.is_circumstance}
    assert {"speed", "low frame rate", "short baseline"} <= names
    assert "this place" not in names  # the scene has no generator
    long_exposure = with_camera(possible, exposure_ms=150.0, shutter="global", readout_ms=None, auto_exposure=None)
    names = {nuisance.name for nuisance in nuisances_of(long_exposure)}
    assert "low frame rate" not in names  # a frame would be shorter than its exposure


def test_only_nuisances_that_an_estimator_notices_are_offered(possible: Case) -> None:
    of_mono = {nuisance.name for nuisance in nuisances_of(possible, sensors=["mono"])}
    assert not {"wheel slip", "encoder errors", "short baseline"} & of_mono
    assert {"speed", "blur"} <= of_mono
    of_wheels = {nuisance.name for nuisance in nuisances_of(possible, sensors=["stereo", "encoders"])}
    assert {"wheel slip", "encoder errors", "short baseline"} <= of_wheels
    assert "speed" not in of_wheels  # the replayed path has no wheels


def test_twice_the_baseline_keeps_the_middle_between_the_cameras(possible: Case) -> None:
    wide = without(possible, ["short baseline"])
    before = possible.build_rig()
    after = wide.build_rig()
    assert after.baseline_m == pytest.approx(2 * before.baseline_m)
    middles_m = []
    for rig in (before, after):
        left_m = rig.T_body_camera("left")[:3, 3]
        right_m = rig.T_body_camera("right")[:3, 3]
        middles_m.append((left_m + right_m) / 2)
    np.testing.assert_allclose(middles_m[0], middles_m[1], atol=1e-12)


def test_another_place_is_that_of_the_next_seed_in_the_same_lighting(hard: Case) -> None:
    scene = SceneFile(name="flat", generator="maker.py", generated=GeneratedSpec(seed=4, lighting="night"))
    wander = Wander(length_m=3.0)
    case = replace(hard, scene=scene, trajectory=wander)
    elsewhere = without(case, ["this place"])
    assert elsewhere.scene.generated == GeneratedSpec(seed=5, lighting="night")
    assert elsewhere.variant["scene"] == "flat.5.night"
    assert without(replace(case, trajectory=hard.trajectory), ["this place"]).scene == scene


def test_shadowless_light_is_as_strong_and_dims_as_the_strongest_lamp_did(hard: Case) -> None:
    changed = without(hard, ["shadows"])
    (panel,) = changed.scene.lamps
    assert panel.power_lm == 400
    assert panel.level == hard.lighting["lamp"].level
    assert not changed.lighting


def test_a_wider_range_keeps_what_was_in_range_and_holds_eight_times_the_light(hard: Case) -> None:
    camera = replace(
        without(hard, ["noise", "auto-exposure"]).camera, motion_blur=False, exposure_gain=1.0, gain_db=0.0
    )
    wide = without(replace(hard, camera=camera), [BURNT]).camera
    assert wide.white_e == camera.white_e
    glaring = replace(camera, exposure_gain=20.0, gain_db=6.0)
    assert without(replace(hard, camera=glaring), [BURNT]).camera.white_e * 10**0.3 == pytest.approx(camera.white_e)
    light = np.linspace(0.02, 6, 64, dtype=np.float32)[None]
    streams = NoiseStreams(np.random.default_rng(0), np.random.default_rng(0))
    before, after = (expose(light, each, streams).astype(float) for each in (camera, wide))
    in_range = before < 250
    np.testing.assert_allclose(after[in_range] / before[in_range], 0.9, atol=0.03)
    assert (before == 255).sum() > 20
    assert (after < 255).all()
    assert (np.diff(after[0]) >= 0).all()


def test_the_wider_range_is_eight_full_wells_and_what_was_white_is_a_tenth_below_it(hard: Case) -> None:
    camera = replace(hard.camera, chip=replace(hard.camera.chip, black_dn=4.0))
    chip = without(replace(hard, camera=camera), [BURNT]).camera.chip
    assert chip.full_well_e == 8 * camera.chip.full_well_e
    assert chip.black_dn == 0.5
    response = np.array(chip.response)
    assert len(response) == 256
    assert (np.diff(response) > 0).all()
    white = int(np.flatnonzero(response >= 1)[0])
    assert white == pytest.approx(0.9 * 255, abs=1)
    assert response[-1] == 8


def test_auto_exposure_aims_at_the_same_light_in_a_wider_range(hard: Case) -> None:
    loop = without(hard, [BURNT]).camera.auto_exposure
    assert loop == replace(hard.camera.auto_exposure, target_share=hard.camera.auto_exposure.target_share / 8)
