"""A case that cannot be driven is refused before anything is rendered."""

import pytest

from vobench.errors import SuiteError
from vobench.pipeline.motion import drive_all
from vobench.suite.expand import read_plan

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


def test_a_camera_above_the_furniture_is_none_of_our_business(at_height):
    assert drive_all(at_height(0.9))["desk"].reached
