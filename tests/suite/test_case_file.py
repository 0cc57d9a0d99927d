"""A case, written as a suite of its own, is the same case."""

from pathlib import Path

import pytest
from ruamel.yaml import YAML

from vobench.runner.simulate import content
from vobench.suite.case_file import write_case
from vobench.suite.suite import read_plan

SCENE = """
name: hall
white_cd_m2: 50
materials: {grain: {kind: polished, pattern: terrazzo, albedo: 0.5, resolution_px: 64}}
room: {size_m: [2, 2, 1.5], floor: grain, wall: brick, ceiling: paint}
lamps: [{name: lamp, kind: point, center_m: [0, 0, 1.4], power_lm: 600, level: {dimmer: [[0, 1], [2, 0.5]]}}]
sky: {illuminance_lx: 100}
"""
SUITE = """
name: one
seed: 7
scenes: [hall]
lightings: {dark: {lamp: {power_lm: 10}}}
rigs: {down: {pitch_deg: 90, imu: mpu6000}}
trajectories: {WAY}
cameras: {noisy: {sensor: mt9v034, auto_exposure: {}, shutter: rolling, readout_ms: 10}}
truth: [depth]
truth_noise: {position_m: 0.005}
frames: [1, 3]
estimators: [{name: feature_vo, label: sift, params: {detector: sift}, limits: {frame_s: 3}}]
"""
POSES = "".join(f"{n / 10} {n / 50} 0 0 0 0 0 1\n" for n in range(12))


@pytest.mark.parametrize(
    "way",
    [
        "short: {targets_m: [[0.3, 0]], rate_hz: 5}",
        "round: {kind: circle, radius_m: 0.3, speed_mps: 0.2, mover: unicycle}",
        "again: {kind: replay, file: was.tum, axes: body, start_m: [0.1, 0, 0], rate_hz: 5}",
    ],
)
def test_what_is_written_reads_as_the_same_case_wherever_it_lies(tmp_path: Path, way: str) -> None:
    (tmp_path / "hall.yaml").write_text(SCENE)
    (tmp_path / "was.tum").write_text(POSES)
    (tmp_path / "suite.yaml").write_text(SUITE.replace("WAY", way))
    plan = read_plan(str(tmp_path / "suite.yaml"))
    (case,) = plan.simulated
    written = write_case(case, plan.estimator_entries, tmp_path / "away", name="again")
    (tmp_path / "away").rename(tmp_path / "moved")
    again = read_plan(str(tmp_path / "moved" / written.name))
    assert content(again.simulated[0]) == content(case)
    assert again.simulated[0].truth_noise == case.truth_noise
    assert again.estimator_entries == plan.estimator_entries


def test_an_estimator_is_written_with_those_limits_alone_that_are_not_its_manifests(bent, tmp_path):
    plan = bent(("stand_still,", "{name: stand_still, label: slow, limits: {frame_s: 1.5}},"))
    path = write_case(plan.simulated[0], plan.estimator_entries, tmp_path / "case", name="copy")
    estimators = YAML(typ="safe").load(path)["estimators"]
    assert estimators == [
        {"name": "stand_still", "label": "slow", "limits": {"frame_s": 1.5}},
        {"name": "constant_velocity", "params": {"measure_s": 0.1}},
    ]


def test_only_what_differs_from_the_defaults_is_written(tmp_path: Path) -> None:
    (tmp_path / "hall.yaml").write_text(SCENE)
    text = SUITE.replace("WAY", "short: {targets_m: [[0.3, 0]], rate_hz: 5}")
    text = text.replace("rigs: {down: {pitch_deg: 90, imu: mpu6000}}", "rigs: {down: {pitch_deg: 90}}")
    text = text.replace("cameras: {noisy: {sensor: mt9v034, auto_exposure: {}, shutter: rolling, readout_ms: 10}}", "")
    (tmp_path / "suite.yaml").write_text(text.replace("truth_noise: {position_m: 0.005}\n", ""))
    plan = read_plan(str(tmp_path / "suite.yaml"))
    written = write_case(plan.simulated[0], plan.estimator_entries, tmp_path / "away", name="again")
    suite = YAML(typ="safe").load(written)
    assert suite["rigs"] == {"down": {"pitch_deg": 90}}
    assert suite["trajectories"] == {"short": {"kind": "waypoints", "targets_m": [[0.3, 0]], "rate_hz": 5}}
    assert list(suite["cameras"].values()) == [{}]
    assert not {"truth_noise", "rendering"} & set(suite)
    scene = YAML(typ="safe").load(tmp_path / "away" / "hall.yaml")
    assert scene["sky"] == {"kind": "overcast", "illuminance_lx": 100}
    assert scene["materials"]["grain"]["kind"] == "polished"
    assert "movers" not in scene
