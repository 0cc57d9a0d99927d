"""A case that cannot be driven is refused before anything is rendered."""

from dataclasses import replace

import pytest

from vobench.errors import SuiteError
from vobench.pipeline.motion import drive_all
from vobench.suite.expand import read_plan
from vobench.suite.scene_spec import MoverSpec

SUITE = """
name: boxed
scenes: [room]
rigs: {{down: {{pitch_deg: 90, height_m: {height_m}}}}}
trajectories: {{desk: {{targets_m: [[3.2, -1.5]]}}}}
estimators: [stand_still]
"""


@pytest.fixture
def at_height(tmp_path):
    """A drive to the desk of the built-in room, which is 0.8 m high, with cameras this high."""

    def plan(height_m):
        (tmp_path / "boxed.yaml").write_text(SUITE.format(height_m=height_m))
        return read_plan(str(tmp_path / "boxed.yaml"))

    return plan


def test_a_camera_inside_the_furniture_is_refused_with_place_and_time(at_height, tmp_path):
    with pytest.raises(SuiteError) as refused:
        drive_all(at_height(0.4))
    said = str(refused.value)
    assert said.startswith(
        f"{tmp_path / 'boxed.yaml'}:5: trajectories.desk: a camera of rig 'down' is inside the box of"
    )
    assert "wood at (3.2, -1.5, 0.4) m of scene 'room' after" in said


def test_a_camera_inside_a_mover_is_refused_with_place_and_time(at_height, tmp_path):
    plan = at_height(0.9)
    keys = tuple({"t_s": float(t), "position_m": (4.0 - 2 * t, -1.5, 1.2)} for t in (0, 1))
    cart = MoverSpec(name="cart", size_m=(0.4, 0.4, 0.8), material="wood", path=keys, repeats=True)
    scene = plan.cases[0].scene.model_copy(update={"movers": (cart,)})
    with pytest.raises(SuiteError, match=r"a camera of rig 'down' is inside the mover 'cart' of scene 'room' after"):
        drive_all(replace(plan, cases=(plan.cases[0].model_copy(update={"scene": scene}),)))


def test_a_camera_above_the_furniture_is_none_of_our_business(at_height):
    assert drive_all(at_height(0.9))["desk"].reached


@pytest.mark.parametrize(
    ("camera", "sentence"),
    [
        ("exposure_ms: 40", "exposure_ms 40 is longer than a frame of trajectory 'desk', which lasts 33.3 ms at 30 Hz"),
        ("shutter: rolling, readout_ms: 34", "readout_ms 34 is longer"),
        ("auto_exposure: {t_max_ms: 50}", "auto_exposure.t_max_ms 50 is longer"),
    ],
)
def test_pictures_that_take_longer_than_a_frame_are_refused(tmp_path, camera, sentence):
    suite = SUITE.format(height_m=0.9) + f"cameras: {{slow: {{{camera}}}}}\n"
    (tmp_path / "slow.yaml").write_text(suite)
    with pytest.raises(SuiteError) as refused:
        drive_all(read_plan(str(tmp_path / "slow.yaml")))
    assert str(refused.value).startswith(f"{tmp_path / 'slow.yaml'}:7: cameras.slow: {sentence}")
