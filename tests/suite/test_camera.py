"""What a suite may say of a camera, what it comes to, and the one sentence for what it may not say."""

import json
from dataclasses import replace
from pathlib import Path

import pytest

from vobench.errors import SuiteError
from vobench.sensor.exposure import AutoExposure, Exposure
from vobench.sensor.image_sensor import CAMERAS, CameraSensor, CameraSettings
from vobench.setting import hints
from vobench.suite.axis import Camera
from vobench.suite.yaml_file import checked, plain

# ruff: noqa: E501 - a sentence stands in one line


def camera(bent, text: str) -> CameraSettings:
    return bent(("{sensor: clean}", text)).cases[0].camera


def test_a_camera_of_which_nothing_is_said_is_clean_sharp_and_global(bent) -> None:
    assert camera(bent, "{}") == CameraSettings() == CameraSettings(chip=CAMERAS["clean"])


def test_every_sensor_is_taken_as_it_is_unless_the_suite_says_otherwise() -> None:
    for name, sensor in CAMERAS.items():
        assert checked(Camera, {"sensor": name, "chip": {}}) == checked(Camera, name) == CameraSettings(chip=sensor)


@pytest.mark.parametrize(
    ("text", "changes"),
    [
        ("full_well_e: 1000", {"full_well_e": 1000.0}),
        ("shot_noise: false", {"shot_noise": False}),
        ("read_noise_e: 3", {"read_noise_e": 3.0}),
        ("prnu: 0", {"prnu": 0.0}),
        ("hot_share: 0.01, hot_e_per_s: 100", {"hot_share": 0.01, "hot_e_per_s": 100.0}),
        ("adc_bits: 12", {"adc_bits": 12}),
        ("adc_bits: null", {"adc_bits": None}),
        ("response: linear", {"response": "linear"}),
        ("response: 2", {"response": 2.0}),
        ("response: [0, 0.2, 1]", {"response": (0.0, 0.2, 1.0)}),
    ],
)
def test_an_override_changes_one_property_of_the_chip(bent, text: str, changes: dict[str, object]) -> None:
    chip = camera(bent, f"{{sensor: mt9v034, chip: {{{text}}}}}").chip
    assert chip == replace(CAMERAS["mt9v034"], **changes)


def test_milliseconds_become_seconds(bent) -> None:
    said = camera(bent, "{exposure_ms: 8, gain_db: 6, shutter: rolling, readout_ms: 20}")
    assert said.exposure == Exposure(0.008, 6.0)
    assert said.readout_s == 0.02
    assert CameraSettings().readout_s == 0.0


def test_auto_exposure_without_settings_is_the_default_loop(bent) -> None:
    assert camera(bent, "{auto_exposure: {}}").auto_exposure == AutoExposure()


@pytest.mark.parametrize("response", ["linear", 2.2, [0, 0.2, 1]])
def test_a_camera_goes_through_json_unchanged(response) -> None:
    settings = checked(Camera, {"chip": {"response": response}, "auto_exposure": {}})
    assert checked(Camera, json.loads(json.dumps(plain(settings)))) == settings


KNOWN = ", ".join(sorted(["sensor", *hints(CameraSettings)]))
CHIP_KNOWN = ", ".join(sorted(hints(CameraSensor)))
A_RESPONSE = "should be linear, srgb, a gamma such as 2.2 or a list of rising signals"


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("{exposure: 5}", f".exposure: unknown key. Did you mean 'exposure_ms'? Known: {KNOWN}"),
        ("{chip: {read_noise: 5}}", f".chip.read_noise: unknown key. Did you mean 'read_noise_e'? Known: {CHIP_KNOWN}"),
        ("{chip: {read_noise_e: -5}}", ".chip.read_noise_e: should be 0 or more (got -5)"),
        ("{chip: {adc_bits: 9}}", ".chip.adc_bits: should be 8, 10 or 12 (got 9)"),
        ("{chip: {shot_noise: 1}}", ".chip.shot_noise: should be true or false (got 1)"),
        ("{chip: {response: lin}}", ".chip.response: no response named 'lin'. Did you mean 'linear'? Known: linear, srgb"),
        ("{chip: {response: true}}", f".chip.response: {A_RESPONSE} (got True)"),
        ("{chip: {response: [0, a]}}", f".chip.response: {A_RESPONSE} (got (0, 'a'))"),
        ("{chip: {response: [0, 2, 1]}}", ".chip.response: a tabulated response should rise, but value 2 is 1.0 after 2.0"),
        ("{chip: {response: 0}}", ".chip.response: the gamma of a response should be within 0.1 and 10, got 0.0"),
        ("{exposure_ms: 0}", ".exposure_ms: should be 0.001 or more (got 0)"),
        ("{shutter: roling}", ".shutter: should be 'global' or 'rolling' (got 'roling')"),
        ("{shutter: rolling}", ": a rolling shutter needs readout_ms: rows × the time from one row to the next, such as 20"),
        ("{readout_ms: 20}", ": readout_ms belongs to a rolling shutter; add shutter: rolling"),
        ("{motion_blur: 8}", ".motion_blur: should be true or false (got 8)"),
        ("{jpeg_quality: 0}", ".jpeg_quality: should be 1 or more (got 0)"),
        ("{dirt: 0.9}", ".dirt: should be 0.5 or less (got 0.9)"),
        ("{auto_exposure: true}", ".auto_exposure: should be keys with values (got true)"),
        ("{auto_exposure: {lag: 1}}", ".auto_exposure.lag: unknown key. Known: damping, gain_max_db, lag_frames, percentile, t_max_ms, t_min_ms, target_share"),
        ("{auto_exposure: {damping: 1}}", ".auto_exposure.damping: should be less than 1 (got 1)"),
        ("{auto_exposure: {t_min_ms: 30}}", ".auto_exposure.t_min_ms: should be at most t_max_ms, but is 30 against 20"),
    ],
)  # fmt: skip
def test_a_wrong_camera_gets_one_line_with_its_place_and_remedy(bent, tmp_path, text: str, sentence: str) -> None:
    with pytest.raises(SuiteError) as refused:
        camera(bent, text)
    assert str(refused.value).removeprefix(str(tmp_path / "tiny.yaml")) == f":7: cameras.clean{sentence}"


PAGE = (Path(__file__).parents[2] / "docs" / "cameras.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", CAMERAS)
def test_every_sensor_is_in_the_docs_with_its_figures(name: str) -> None:
    sensor = CAMERAS[name]
    (row,) = [line for line in PAGE.splitlines() if line.startswith(f"| `{name}`")]
    for value in (sensor.full_well_e, sensor.read_noise_e, 100 * sensor.prnu, sensor.dsnu_e, sensor.column_e):
        assert f" {value:g} " in row


def test_the_cameras_of_the_docs_are_valid(bent) -> None:
    text = PAGE.split("```yaml\n")[1].split("```")[0]
    cases = bent(("cameras: {clean: {sensor: clean}}\n", text)).cases
    assert {case.variant["camera"] for case in cases} == {"ideal", "euroc", "phone", "loud"}
