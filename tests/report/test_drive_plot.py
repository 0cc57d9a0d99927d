"""A drive's plot says what it shows: names, units, equal axes; and is the same file for the same drive."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from vobench.errors import InputError
from vobench.geometry import se3
from vobench.report import drive_plot
from vobench.report.drive_plot import DriveLog, save_drive_plot, save_sheet
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
    save_drive_plot(tmp_path / "it.svg", [log])
    said = words(tmp_path / "it.svg")
    labels = {"straight", "x (m)", "y (m)", "u (m/s)", "ω (rad/s)", "to target (m)", "time (s); dotted: end of a leg"}
    assert labels | {"u requested", "ω requested", "body B", "point h", "targets of h", "start"} <= set(said)


def test_what_nobody_leads_has_no_references_and_what_flies_a_height(log, tmp_path):
    alone = replace(log, point_m=None, references=None, targets_m=None, reached_s=None)
    save_drive_plot(tmp_path / "floor.svg", [alone])
    assert "heading (°)" in words(tmp_path / "floor.svg")
    assert not {"u requested", "point h", "height z (m)"} & set(words(tmp_path / "floor.svg"))
    poses = log.T_world_body.copy()
    poses[:, 2, 3] = T_S
    save_drive_plot(tmp_path / "air.svg", [replace(alone, T_world_body=poses)])
    assert {"height z (m)", "|v| (m/s)", "|ω| (rad/s)"} <= set(words(tmp_path / "air.svg"))


def test_each_leg_is_measured_to_its_own_target_and_from_its_end_on_to_the_next(log):
    legs = replace(log, targets_m=np.array([[1.2, 0.0], [2.2, 0.5]]), reached_s=np.array([2.0, 4.0]))
    np.testing.assert_allclose(legs.to_target_m[[0, 19, 20, 40]], [[1.0, 0.0], [0.05, 0.0], [1.0, 0.5], [0.0, 0.5]])
    assert replace(legs, reached_s=None).to_target_m is None


def test_patches_of_floor_are_drawn_and_each_surface_is_named_once(log, tmp_path):
    corners_m = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.5], [0.0, 0.5]])
    save_drive_plot(
        tmp_path / "it.svg", [replace(log, patches=(("wet", corners_m), ("wet", corners_m + 1), ("seam", corners_m)))]
    )
    named = [word for word in words(tmp_path / "it.svg") if word in {"wet", "seam"}]
    assert sorted(named) == ["seam", "wet"]


def plan_points_m(path):
    """The corners of the line of the floor plan in an SVG, in its own units."""
    text = path.read_text()
    end = text.index(f"stroke: {drive_plot.PLAN}")
    start = text.rindex('<path d="', 0, end) + len('<path d="')
    return text[start:end].count("M ")


def test_a_path_is_drawn_in_the_plan_of_its_place_as_far_as_it_is_near(log, tmp_path):
    wall_m = np.array([[[-50.0, 1.0], [50.0, 1.0]]])  # it passes the path, and ends far away
    crate_m = np.array([[[1.0, -0.5], [1.2, -0.5]]])
    far_m = np.array([[[80.0, 80.0], [80.0, 81.0]]])
    save_drive_plot(tmp_path / "it.svg", [replace(log, outlines_m=np.concatenate([wall_m, crate_m, far_m]))])
    assert plan_points_m(tmp_path / "it.svg") == 2
    save_drive_plot(tmp_path / "far.svg", [replace(log, outlines_m=far_m)])
    save_drive_plot(tmp_path / "none.svg", [log])
    assert (tmp_path / "far.svg").read_bytes() == (tmp_path / "none.svg").read_bytes()


def test_several_logs_are_rows_of_one_figure_and_the_same_file_twice(log, tmp_path):
    logs = [log, replace(log, title="again")]
    for name in ("a.svg", "b.svg"):
        save_drive_plot(tmp_path / name, logs)
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()
    assert {"straight", "again"} <= set(words(tmp_path / "a.svg"))


def test_a_body_that_stays_in_place_or_for_an_instant_can_be_drawn(log, tmp_path):
    still = np.tile(se3.transform(np.eye(3), [1.0, 2.0, 0.0]), (41, 1, 1))
    instant = DriveLog("instant", T_S[:1], still[:1], np.zeros((1, 6)))
    save_drive_plot(tmp_path / "it.png", [DriveLog("still", T_S, still, np.zeros((41, 6))), instant])
    assert (tmp_path / "it.png").stat().st_size > 10_000


def test_a_sheet_has_every_path_and_its_title(log, tmp_path):
    save_sheet(tmp_path / "it.svg", [replace(log, title=f"way {k}") for k in range(7)])
    assert {f"way {k}" for k in range(7)} <= set(words(tmp_path / "it.svg"))


def test_another_ending_is_refused(log, tmp_path):
    with pytest.raises(InputError, match=r"should end in \.svg, \.png, \.pdf, got .*it\.jpg"):
        save_drive_plot(tmp_path / "it.jpg", [log])


def figure():
    from matplotlib.figure import Figure

    return Figure()


def looks(axes):
    """Label, colour, width, dashes and marker of each curve."""
    return [
        (line.get_label(), line.get_color(), line.get_linewidth(), line.get_linestyle(), line.get_marker())
        for line in axes.get_lines()
        if line.get_label() != "" and not line.get_label().startswith("_")
    ]


def test_each_curve_of_a_path_has_the_look_of_its_kind(log):
    axes = figure().add_subplot()
    drive_plot._path(axes, log)
    assert [look[:2] for look in looks(axes)] == [
        ("body B", "#0072B2"),
        ("point h", "#009E73"),
        ("start", "#0072B2"),
        ("targets of h", "black"),
    ]
    body, point, start, targets = axes.get_lines()
    assert (body.get_linewidth(), point.get_linewidth()) == (1.4, 0.9)
    assert (start.get_marker(), start.get_markersize(), len(start.get_xdata())) == ("o", 5, 1)
    assert (targets.get_marker(), targets.get_markersize(), targets.get_markeredgewidth()) == ("x", 6, 1.4)
    assert targets.get_linestyle() == "None"
    assert [(text.get_text(), tuple(text.xy), text.xyann) for text in axes.texts] == [("1", (2.2, 0.0), (4, 4))]


@pytest.mark.parametrize(("legend", "scale", "width"), [(True, 18, 0.004), (False, 9, 0.008)])
def test_arrows_are_longer_in_a_small_plot_and_at_even_times(log, legend, scale, width):
    axes = figure().add_subplot()
    drive_plot._path(axes, log, legend=legend)
    (arrows,) = axes.collections
    assert (arrows.scale, arrows.width, arrows.headwidth, arrows.N) == (scale, width, 4, drive_plot.ARROWS)
    assert (arrows.XY[0].tolist(), arrows.XY[-1].tolist()) == ([0, 0], [2, 0])
    assert (axes.get_legend() is not None) == legend


def test_floors_have_their_colours_and_unknown_ones_a_neutral_one(log):
    axes = figure().add_subplot()
    corners_m = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.5], [0.0, 0.5]])
    drive_plot._path(axes, replace(log, patches=(("wet", corners_m), ("moss", corners_m))))
    wet, moss = axes.patches
    assert wet.get_facecolor() == pytest.approx((0x56 / 255, 0xB4 / 255, 0xE9 / 255, 0.25))
    assert moss.get_facecolor() == pytest.approx((0x7F / 255, 0x7F / 255, 0x7F / 255, 0.25))
    assert wet.get_linewidth() == 0


def draw(log):
    row = figure().subfigures(1, 1)
    drive_plot._draw(row, log)
    return row


def test_speeds_are_drawn_beside_their_references_and_distances_below(log):
    path, speed, turn, rest = draw(log).axes
    assert looks(speed) == [("u requested", "#D55E00", 0.8, "-", "None"), ("u", "#0072B2", 1.2, "-", "None")]
    assert looks(turn) == [("ω requested", "#D55E00", 0.8, "-", "None"), ("ω", "#0072B2", 1.2, "-", "None")]
    assert looks(rest) == [("x", "#0072B2", 1.2, "-", "None"), ("y", "#009E73", 1.2, "-", "None")]
    assert [axes.get_ylabel() for axes in (path, speed, turn, rest)] == [
        "y (m)",
        "u (m/s)",
        "ω (rad/s)",
        "to target (m)",
    ]
    for axes, values in ((speed, log.twist[:, 0]), (turn, log.twist[:, 5])):
        np.testing.assert_array_equal(axes.get_lines()[1].get_ydata(), values)
        np.testing.assert_array_equal(axes.get_lines()[1].get_xdata(), log.t_s)
    np.testing.assert_array_equal(rest.get_lines()[0].get_ydata(), log.to_target_m[:, 0])
    assert path.get_position().width < speed.get_position().width


def test_the_ends_of_legs_are_dotted_lines_in_every_panel_of_time(log):
    legs = replace(log, targets_m=np.array([[1.2, 0.0], [2.2, 0.5]]), reached_s=np.array([2.0, 4.0]))
    _, *panels = draw(legs).axes
    for axes in panels:
        ends = [line for line in axes.get_lines() if line.get_linestyle() == ":"]
        assert [line.get_xdata()[0] for line in ends] == [2.0, 4.0]
        assert {(line.get_color(), line.get_linewidth()) for line in ends} == {("black", 0.6)}
        assert axes.get_xlim() == (0.0, 4.0)
    assert panels[-1].get_xlabel() == "time (s); dotted: end of a leg"
    assert [panel.get_xlabel() for panel in panels[:2]] == ["", ""]


def test_an_instant_has_a_millisecond_of_room(log):
    instant = DriveLog("instant", T_S[:1], log.T_world_body[:1], np.zeros((1, 6)))
    _, speed, *_ = draw(instant).axes
    assert speed.get_xlim() == pytest.approx((0.0, 1e-3))
    assert draw(instant).axes[-1].get_xlabel() == "time (s)"


def test_what_flies_has_magnitudes_and_a_height_and_what_drives_alone_a_heading(log):
    alone = replace(log, point_m=None, references=None, targets_m=None, reached_s=None)
    turning = replace(alone, T_world_body=level(0 * T_S, 0 * T_S, 2 * T_S))
    heading = draw(turning).axes[-1].get_lines()[0]
    np.testing.assert_allclose(heading.get_ydata(), np.rad2deg(2 * T_S), atol=1e-9)
    poses = log.T_world_body.copy()
    poses[:, 2, 3] = T_S
    twist = np.tile([3.0, 4.0, 0.0, 0.0, 0.6, 0.8], (41, 1))
    _, speed, turn, height = draw(replace(alone, T_world_body=poses, twist=twist)).axes
    np.testing.assert_allclose(speed.get_lines()[0].get_ydata(), 5.0)
    np.testing.assert_allclose(turn.get_lines()[0].get_ydata(), 1.0)
    np.testing.assert_array_equal(height.get_lines()[0].get_ydata(), T_S)
    assert {line.get_linewidth() for axes in (speed, turn, height) for line in axes.get_lines()} == {1.2}


@pytest.mark.parametrize(
    ("row", "column", "size", "flies"),
    [(2, 3, 1e-5, True), (2, 0, 1e-5, True), (2, 1, 1e-5, True), (2, 3, 1e-7, False), (1, 3, 1.0, False)],
)
def test_to_leave_the_floor_is_to_rise_roll_or_pitch(log, row, column, size, flies):
    poses = log.T_world_body.copy()
    poses[20, row, column] += size
    assert replace(log, T_world_body=poses).leaves_the_floor == flies


def test_a_log_is_that_of_its_drive():
    def drive(name, simulated):
        spec = SimpleNamespace(kind="circle")
        motion = SimpleNamespace(drive=simulated, t_ns=np.array([0, 500_000_000]))
        body = SimpleNamespace(T_world_body=np.tile(np.eye(4), (2, 1, 1)), twist=np.zeros((2, 6)))
        case = SimpleNamespace(trajectory=spec)
        return SimpleNamespace(
            case=case,
            motion=motion,
            body=body,
            frames=[0, 2],
            kind="circle",
            name=name,
            references=None,
            reached_s=None,
        )

    state = np.arange(12.0).reshape(3, 4)
    log = drive_plot.drive_log(drive("circle", SimpleNamespace(state=state)))
    assert log.title == "circle"
    assert log.t_s.tolist() == [0.0, 0.5]
    assert log.point_m.tolist() == [[0, 1], [8, 9]]
    assert (log.targets_m, log.patches) == (None, ())
    alone = drive_plot.drive_log(drive("mine", None))
    assert (alone.title, alone.point_m) == ("mine: circle", None)


def test_a_sheet_has_five_paths_in_a_row(log, tmp_path, monkeypatch):
    sizes = []
    make = drive_plot._figure
    monkeypatch.setattr(drive_plot, "_figure", lambda *size: sizes.append(size) or make(*size))
    save_sheet(tmp_path / "it.svg", [log] * 6)
    save_drive_plot(tmp_path / "it.svg", [log] * 2)
    assert sizes == [pytest.approx((11.5, 4.6)), pytest.approx((9.0, 7.2))]
