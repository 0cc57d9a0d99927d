"""What makes a case hard, and the change that takes it away."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.analysis.nuisance import NUISANCES, nuisances_of, without
from vobench.sensor.image_sensor import NoiseStreams, expose
from vobench.suite.suite import Case

BURNT = "burnt pixels"


def test_a_case_with_everything_has_every_nuisance_and_without_them_none_but_its_range(hard: Case) -> None:
    names = [nuisance.name for nuisance in nuisances_of(hard)]
    assert names == [nuisance.name for nuisance in NUISANCES]
    assert [nuisance.name for nuisance in nuisances_of(without(hard, names))] == [BURNT]


def test_what_removals_make_can_be_built_and_in_any_order_is_the_same(hard: Case) -> None:
    for nuisance in NUISANCES:
        without(hard, [nuisance.name]).build_scene()
    names = [nuisance.name for nuisance in NUISANCES]
    assert without(hard, names) == without(hard, names[::-1])


def test_a_removal_leaves_the_way_and_the_seed(hard: Case) -> None:
    for nuisance in NUISANCES:
        changed = nuisance.remove(hard)
        assert (changed.trajectory, changed.seed, changed.name) == (hard.trajectory, hard.seed, hard.name)


def test_what_is_not_seen_in_any_frame_is_not_removed(hard: Case) -> None:
    kept = {nuisance.name for nuisance in nuisances_of(hard, {"mirror": 0.0, "moving": 0.3})}
    assert "mirrors" not in kept
    assert {"moving things", "gloss", "noise"} <= kept


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
