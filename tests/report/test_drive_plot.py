"""A drive's plot says what it shows: names, units, equal axes; and is the same file for the same drive."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.errors import InputError
from vobench.geometry import se3
from vobench.report.drive_plot import DriveLog, save_plot, save_sheet
from vobench.trajectory.kinematics import level

T_S = np.linspace(0, 4, 41)


@pytest.fixture
def log():
    """A robot on a straight way of 2 m through one target."""
    twist = np.zeros((41, 6))
    twist[:, 0] = 0.5
    return DriveLog(
        title="straight",
        t_s=T_S,
        T_world_body=level(T_S / 2, 0 * T_S, 0 * T_S),
        twist=twist,
        point_m=np.stack([T_S / 2 + 0.2, 0 * T_S], -1),
        references=np.tile([0.5, 0.0], (41, 1)),
        targets_m=np.array([[2.2, 0.0]]),
        reached_s=np.array([4.0]),
    )


def words(path):
    """What a reader of an SVG sees, by the comments that matplotlib leaves on each text."""
    return [line.strip()[5:-4] for line in path.read_text().splitlines() if line.strip().startswith("<!-- ")]


def test_a_led_robot_is_drawn_against_what_was_asked_of_it(log, tmp_path):
    save_plot(tmp_path / "it.svg", [log])
    said = words(tmp_path / "it.svg")
    labels = {"straight", "x (m)", "y (m)", "u (m/s)", "ω (rad/s)", "to target (m)", "time (s); dotted: end of a leg"}
    assert labels | {"u requested", "ω requested", "body B", "point h", "targets of h", "start"} <= set(said)


def test_what_nobody_leads_has_no_references_and_what_flies_a_height(log, tmp_path):
    alone = replace(log, point_m=None, references=None, targets_m=None, reached_s=None)
    save_plot(tmp_path / "floor.svg", [alone])
    assert "heading (°)" in words(tmp_path / "floor.svg")
    assert not {"u requested", "point h", "height z (m)"} & set(words(tmp_path / "floor.svg"))
    poses = log.T_world_body.copy()
    poses[:, 2, 3] = T_S
    save_plot(tmp_path / "air.svg", [replace(alone, T_world_body=poses)])
    assert {"height z (m)", "|v| (m/s)", "|ω| (rad/s)"} <= set(words(tmp_path / "air.svg"))


def test_each_leg_is_measured_to_its_own_target_and_from_its_end_on_to_the_next(log):
    legs = replace(log, targets_m=np.array([[1.2, 0.0], [2.2, 0.5]]), reached_s=np.array([2.0, 4.0]))
    np.testing.assert_allclose(legs.to_target_m[[0, 19, 20, 40]], [[1.0, 0.0], [0.05, 0.0], [1.0, 0.5], [0.0, 0.5]])
    assert replace(legs, reached_s=None).to_target_m is None


def test_patches_of_floor_are_drawn_and_each_surface_is_named_once(log, tmp_path):
    corners_m = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.5], [0.0, 0.5]])
    save_plot(
        tmp_path / "it.svg", [replace(log, patches=(("wet", corners_m), ("wet", corners_m + 1), ("seam", corners_m)))]
    )
    named = [word for word in words(tmp_path / "it.svg") if word in {"wet", "seam"}]
    assert sorted(named) == ["seam", "wet"]


def test_several_logs_are_rows_of_one_figure_and_the_same_file_twice(log, tmp_path):
    logs = [log, replace(log, title="again")]
    for name in ("a.svg", "b.svg"):
        save_plot(tmp_path / name, logs)
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()
    assert {"straight", "again"} <= set(words(tmp_path / "a.svg"))


def test_a_body_that_stays_in_place_or_for_an_instant_can_be_drawn(log, tmp_path):
    still = np.tile(se3.transform(np.eye(3), [1.0, 2.0, 0.0]), (41, 1, 1))
    instant = DriveLog("instant", T_S[:1], still[:1], np.zeros((1, 6)))
    save_plot(tmp_path / "it.png", [DriveLog("still", T_S, still, np.zeros((41, 6))), instant])
    assert (tmp_path / "it.png").stat().st_size > 10_000


def test_a_sheet_has_every_path_and_its_title(log, tmp_path):
    save_sheet(tmp_path / "it.svg", [replace(log, title=f"way {k}") for k in range(7)])
    assert {f"way {k}" for k in range(7)} <= set(words(tmp_path / "it.svg"))


def test_another_ending_is_refused(log, tmp_path):
    with pytest.raises(InputError, match=r"should end in \.svg, \.png, \.pdf, got .*it\.jpg"):
        save_plot(tmp_path / "it.jpg", [log])
