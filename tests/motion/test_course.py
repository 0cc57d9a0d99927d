"""Pieces of a course against their closed forms."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import ellipe, fresnel

from vobench.errors import MotionError, SettingError
from vobench.geometry.rig import PIONEER_WHEELS
from vobench.geometry.se3 import Array
from vobench.motion.course import (
    Circle,
    CoursePiece,
    Figure8,
    Lissajous,
    PureRotation,
    Reverse,
    Square,
    StopAndGo,
    arc_length,
    course,
    lissajous_curve,
    rolled,
)
from vobench.motion.drive import drive
from vobench.trajectory.kinematics import Kinematics, level


def place(pieces, s):
    return course(pieces).at(np.atleast_1d(np.asarray(s, float))).T_world_body[:, :2, 3]


@given(st.floats(0.1, 10), st.floats(0.1, 50))
def test_an_arc_lies_on_its_circle(radius_m, length_m):
    s = np.linspace(0, length_m, 50)
    x, y = place([CoursePiece(length_m, 1 / radius_m)], s).T
    np.testing.assert_allclose(x, radius_m * np.sin(s / radius_m), atol=1e-12 * (radius_m + length_m))
    np.testing.assert_allclose(y, radius_m * (1 - np.cos(s / radius_m)), atol=1e-12 * (radius_m + length_m))


@given(st.floats(0.05, 3), st.floats(0.5, 6))
def test_a_clothoid_is_fresnels(bent, length_m):
    s, scale = np.linspace(0, length_m, 50), np.sqrt(np.pi / bent)
    sine, cosine = fresnel(s / scale)
    np.testing.assert_allclose(
        place([CoursePiece(length_m, bent=bent)], s), scale * np.stack([cosine, sine], -1), atol=1e-11
    )


def test_a_line_back_ends_behind():
    np.testing.assert_allclose(place([CoursePiece(3.0, advance=-1.0)], 3.0), [[-3, 0]], atol=1e-15)


def test_a_turn_on_the_spot_changes_the_heading_alone():
    k = course([CoursePiece(1.0), CoursePiece(np.pi / 2, 1.0, advance=0.0), CoursePiece(2.0)]).at(
        np.array([1.0 + np.pi / 2, 3 + np.pi / 2])
    )
    np.testing.assert_allclose(k.T_world_body[:, :2, 3], [[1, 0], [1, 2]], atol=1e-15)
    np.testing.assert_allclose(k.T_world_body[:, :2, 0], [[0, 1], [0, 1]], atol=1e-15)


def test_ahead_and_back_along_a_clothoid_is_nowhere():
    there, back = CoursePiece(4.0, 0.3, 0.2), CoursePiece(4.0, -1.1, 0.2, advance=-1.0)
    k = course([there, back]).at(np.array([8.0]))
    np.testing.assert_allclose(k.T_world_body[0], np.eye(4), atol=1e-13)


def test_breaks_are_where_pieces_meet_however_far_they_turn():
    np.testing.assert_allclose(
        course([CoursePiece(30.0, 2.0), CoursePiece(1.0), CoursePiece(5.0, -3.0)]).breaks, [30, 31]
    )


@pytest.mark.parametrize("laps", [1, 100, 1000])
def test_many_laps_close(laps):
    np.testing.assert_allclose(
        place([CoursePiece(2 * np.pi * laps, 1.0)], 2 * np.pi * laps), [[0, 0]], atol=1e-12 * laps
    )


SHAPES = [
    ((4.0, 2.0), (1, 2), 0.0),
    ((3.0, 3.0), (1, 1), np.pi / 2),
    ((5.0, 3.0), (3, 2), 0.4),
    ((2.0, 4.0), (4, 5), 0.1),
]


@pytest.mark.parametrize(("size_m", "ratio", "phase_rad"), SHAPES)
def test_its_points_satisfy_its_equation(size_m, ratio, phase_rad):
    curve = lissajous_curve(size_m, ratio, phase_rad=phase_rad)
    s = np.linspace(0, curve.arc.length, 2000)
    phi = curve.arc.parameter(s)
    x = size_m[0] / 2 * (np.sin(ratio[0] * phi + phase_rad) - np.sin(phase_rad))
    y = size_m[1] / 2 * np.sin(ratio[1] * phi)
    found = curve.at(s).T_world_body[:, :2, 3]
    np.testing.assert_allclose(np.hypot(*found.T), np.hypot(x, y), atol=1e-12)
    np.testing.assert_allclose([np.ptp(x), np.ptp(y)], size_m, rtol=1e-5)


@pytest.mark.parametrize(("size_m", "ratio", "phase_rad"), SHAPES)
def test_arc_length_is_even_to_twelve_digits(size_m, ratio, phase_rad):
    curve = lissajous_curve(size_m, ratio, phase_rad=phase_rad)
    nodes, weights = np.polynomial.legendre.leggauss(16)
    phi = np.linspace(0, 2 * np.pi, 2001)
    half = np.diff(phi) / 2
    at = (phi[:-1] + half)[:, None] + half[:, None] * nodes
    dx = size_m[0] / 2 * ratio[0] * np.cos(ratio[0] * at + phase_rad)
    dy = size_m[1] / 2 * ratio[1] * np.cos(ratio[1] * at)
    s = np.concatenate([[0], np.cumsum(np.hypot(dx, dy) @ weights * half)])
    assert curve.arc.length == pytest.approx(s[-1], rel=1e-12)
    np.testing.assert_allclose(curve.arc.parameter(s), phi, atol=1e-11)


def test_a_circle_is_one_of_them():
    curve = lissajous_curve((6.0, 6.0), (1, 1), phase_rad=np.pi / 2)
    k = curve.at(np.linspace(0, curve.arc.length, 100))
    assert curve.arc.length == pytest.approx(6 * np.pi, rel=1e-13)
    np.testing.assert_allclose(k.angular_velocity_radps[:, 2], 1 / 3, rtol=1e-12)
    np.testing.assert_allclose(k.angular_acceleration_radps2, 0, atol=1e-12)


def test_it_begins_at_the_origin_along_x_and_every_lap_again():
    curve = lissajous_curve((5.0, 3.0), (3, 2), phase_rad=0.4)
    k = curve.at(np.array([0.0, 1.0, curve.arc.length + 1.0, 7 * curve.arc.length + 1.0]))
    np.testing.assert_allclose(k.T_world_body[0], np.eye(4), atol=1e-15)
    np.testing.assert_allclose(k.T_world_body[2:], k.T_world_body[[1, 1]], atol=1e-11)


@pytest.mark.parametrize("size_m", [0.01, 1.0, 100.0])
def test_how_blunt_a_bend_may_be_hangs_on_its_shape_and_not_on_its_size(size_m):
    assert lissajous_curve((size_m, size_m), (1, 1), phase_rad=0.15).arc.length > size_m
    with pytest.raises(MotionError, match="comes to a point"):
        lissajous_curve((size_m, size_m), (1, 1), phase_rad=0.05)


@pytest.mark.parametrize("ratio", [(1, 1), (1, 2), (2, 1), (1, 3), (3, 2), (3, 5), (5, 4), (7, 9)])
def test_the_phase_that_the_sentence_names_can_be_driven(ratio):
    with pytest.raises(MotionError, match="0 where one number of the ratio is even, a quarter turn where both are odd"):
        lissajous_curve((1.0, 1.0), ratio, phase_rad=0.0 if ratio[0] % 2 and ratio[1] % 2 else np.pi / 2 / ratio[1])
    both_odd = ratio[0] % 2 and ratio[1] % 2
    assert lissajous_curve((1.0, 1.0), ratio, phase_rad=np.pi / 2 if both_odd else 0.0).arc.length > 1


def states(motion, count=4001):
    k = motion.at(np.linspace(motion.start_ns, motion.end_ns, count))
    return k, k.T_world_body[:, :2, 3]


@given(st.floats(0.2, 10), st.floats(0.1, 5), st.floats(0.1, 3))
def test_a_circle_is_laps_times_its_circumference_on_its_circle(radius_m, laps, speed_mps):
    motion = Circle(radius_m=radius_m, speed_mps=speed_mps, laps=laps).way()
    assert motion.law.length == pytest.approx(2 * np.pi * radius_m * laps)
    k, p = states(motion, 101)
    np.testing.assert_allclose(np.hypot(p[:, 0], p[:, 1] - radius_m), radius_m, rtol=1e-10)
    np.testing.assert_allclose(k.angular_velocity_radps[:, 2] * radius_m, k.velocity_mps[:, 0], atol=1e-12)
    assert k.velocity_mps[:, 0].max() <= speed_mps * (1 + 1e-12)


@pytest.mark.parametrize(
    "kind",
    [
        lambda clockwise: Circle(radius_m=2, speed_mps=1, clockwise=clockwise).way(),
        lambda clockwise: Square(side_m=2, speed_mps=1, clockwise=clockwise).way(),
        lambda clockwise: Square(side_m=2, speed_mps=1, corner_radius_m=0.2, clockwise=clockwise).way(),
        lambda clockwise: PureRotation(angle_deg=np.rad2deg(-2.0 if clockwise else 2.0), turn_radps=1).way(),
        lambda clockwise: Reverse(length_m=2, speed_mps=1, radius_m=-3 if clockwise else 3).way(),
    ],
)
def test_clockwise_is_the_mirror_image(kind):
    (left, p_left), (right, p_right) = states(kind(False), 200), states(kind(True), 200)
    np.testing.assert_allclose(p_right, p_left * [1, -1], atol=1e-12)
    np.testing.assert_allclose(right.angular_velocity_radps, -left.angular_velocity_radps, atol=1e-12)
    np.testing.assert_allclose(right.velocity_mps, left.velocity_mps, atol=1e-12)
    assert p_left[:, 1].max() >= 0


def test_a_square_with_stops_has_its_four_corners_and_no_others():
    motion = Square(side_m=2.0, speed_mps=1, laps=2, turn_radps=1.5).way()
    k, p = states(motion)
    turning = np.abs(k.angular_velocity_radps[:, 2]) > 1e-6
    assert not np.abs(k.velocity_mps[turning]).max() > 1e-9
    corners = np.unique(np.round(p[turning], 9) + 0.0, axis=0)
    np.testing.assert_allclose(corners, [[0, 0], [0, 2], [2, 0], [2, 2]], atol=1e-9)
    assert np.diff(motion.breaks_ns).min() > 1e7  # where it stops, the way's break and the law's are one
    assert k.angular_velocity_radps[:, 2].max() == pytest.approx(
        1.2944, rel=1e-3
    )  # sqrt(8/15 pi/2 2): too short for 1.5


@pytest.mark.parametrize("radius_m", [0.05, 0.3])
def test_a_rounded_square_stays_within_its_sides_and_never_turns_tighter(radius_m):
    motion = Square(side_m=3.0, speed_mps=1, corner_radius_m=radius_m).way()
    k, p = states(motion)
    assert np.ptp(p, axis=0) == pytest.approx([3, 3], abs=1e-6)
    moving = k.velocity_mps[:, 0] > 1e-3
    bend = k.angular_velocity_radps[moving, 2] / k.velocity_mps[moving, 0]
    assert bend.max() == pytest.approx(1 / radius_m, rel=0.02)
    assert bend.min() > -1e-12
    np.testing.assert_allclose(motion.law.length, np.linalg.norm(np.diff(p, axis=0), axis=1).sum(), rtol=1e-5)


def test_a_figure_8_turns_as_much_to_either_side_and_has_its_size():
    motion = Figure8(length_m=4, speed_mps=1, laps=3).way()
    k, p = states(motion)
    assert k.angular_velocity_radps[:, 2].max() == pytest.approx(-k.angular_velocity_radps[:, 2].min(), rel=1e-4)
    assert np.hypot(*p.T).max() == pytest.approx(2.0, abs=0.02)
    assert motion.law.length == pytest.approx(3 * Figure8(length_m=4, speed_mps=1).way().law.length)


def test_stop_and_go_rests_for_its_pause_between_its_legs():
    k, p = states(StopAndGo(legs_m=[1.0, 2.0, 0.5], speed_mps=1, pause_s=2.0).way(), 10_001)
    rests = np.abs(k.velocity_mps[:, 0]) < 1e-12
    inner = p[rests & (p[:, 0] > 1e-6) & (p[:, 0] < 3.5 - 1e-6), 0]
    np.testing.assert_allclose(np.unique(np.round(inner, 6)), [1, 3])
    assert not p[:, 1].any()


def test_a_pure_rotation_turns_by_its_angle_and_goes_nowhere():
    motion = PureRotation(angle_deg=np.rad2deg(9.0), turn_radps=0.7).way()
    k, p = states(motion)
    assert np.trapezoid(k.angular_velocity_radps[:, 2], dx=motion.end_ns / 1e9 / 4000) == pytest.approx(9.0, rel=1e-6)
    assert k.angular_velocity_radps[:, 2].max() == pytest.approx(0.7)
    assert not p.any()


@pytest.mark.parametrize("radius_m", [None, 2.0])
def test_reverse_goes_back_over_the_same_poses(radius_m):
    motion = Reverse(length_m=3.0, speed_mps=1, radius_m=radius_m, pause_s=1.0).way()
    t_ns = np.linspace(0, motion.end_ns / 2, 100)
    there, back = motion.at(t_ns), motion.at(motion.end_ns - t_ns)
    np.testing.assert_allclose(back.T_world_body, there.T_world_body, atol=1e-8)
    assert there.velocity_mps[:, 0].min() > -1e-9
    assert back.velocity_mps[:, 0].max() < 1e-9


@pytest.mark.parametrize(
    ("kind", "keys", "sentence"),
    [
        (Circle, {"radius_m": 0}, r"radius_m: should be greater than 0 \(got 0.0\)"),
        (Circle, {"radius_m": np.nan}, "radius_m: should be a finite number"),
        (Circle, {"radius_m": 1, "speed_mps": 0}, "speed_mps: should be greater than 0"),
        (Circle, {"radius_m": 1, "accel_mps2": 0}, "accel_mps2: should be greater than 0"),
        (Circle, {"radius_m": 1, "laps": 0}, "laps: should be greater than 0"),
        (Circle, {"radius_m": 1, "laps": 1001}, "laps: should be 1000 or less"),
        (Circle, {"radius_m": 1, "start_m": (0, np.inf)}, r"start_m\.1: should be a finite number"),
        (Circle, {"radius_m": 1, "start_m": (0,)}, r"start_m\.1: this key is missing"),
        (Square, {"side_m": -1}, "side_m: should be greater than 0"),
        (Square, {"side_m": 1, "laps": 1.5}, "laps: should be a whole number"),
        (Square, {"side_m": 1, "corner_radius_m": -0.1}, "corner_radius_m: should be 0 or more"),
        (Square, {"side_m": 1, "turn_radps": 0}, "turn_radps: should be greater than 0"),
        (Figure8, {"length_m": 0}, "length_m: should be greater than 0"),
        (Lissajous, {"size_m": (0.0, 1.0)}, r"size_m\.0: should be greater than 0"),
        (Lissajous, {"size_m": (1.0,)}, r"size_m\.1: this key is missing"),
        (Lissajous, {"size_m": (1, 1), "phase_deg": np.inf}, "phase_deg: should be a finite number"),
        (
            Lissajous,
            {"size_m": (1, 1), "ratio": (2, 4)},
            r"ratio: .* 1 to 20 without a common divisor \(got \[2, 4\]",
        ),
        (Lissajous, {"size_m": (1, 1), "ratio": (0, 1)}, r"got \[0, 1\]"),
        (Lissajous, {"size_m": (1, 1), "ratio": (1.5, 2)}, r"ratio\.0: should be a whole number"),
        (StopAndGo, {"legs_m": []}, "legs_m: should have 1 or more entries"),
        (StopAndGo, {"legs_m": [1, 0]}, r"legs_m\.1: should be greater than 0"),
        (StopAndGo, {"legs_m": [1], "pause_s": -1}, "pause_s: should be 0 or more"),
        (PureRotation, {"angle_deg": 0}, "angle_deg: should be another angle than 0"),
        (PureRotation, {"angle_deg": np.nan}, "angle_deg: should be a finite number"),
        (Reverse, {"length_m": 1, "radius_m": 0}, "radius_m: should be from 0.01 to 1e5, or less than 0 for right"),
        (Reverse, {"length_m": np.inf}, "length_m: should be a finite number"),
    ],
)
def test_a_setting_that_cannot_be_is_a_sentence_with_its_key(kind, keys, sentence):
    with pytest.raises(SettingError, match=sentence):
        kind(**keys)


@pytest.mark.parametrize(
    ("course_kind", "sentence"),
    [
        (Circle(radius_m=1, speed_mps=1e-9), "from a nanosecond to a day"),
        (Circle(radius_m=1e-300), "it should be from a nanosecond to a day"),
        (Square(side_m=1, corner_radius_m=0.3), r"too wide for a side of 1 m: .* it should be below 0\.267"),
        (Lissajous(size_m=(1, 1), ratio=(1, 1)), "comes to a point where it turns back; choose another phase"),
        (Lissajous(size_m=(1, 1), phase_deg=45), "comes to a point"),
    ],
)
def test_what_cannot_be_driven_is_a_sentence(course_kind, sentence):
    with pytest.raises(MotionError, match=sentence):
        course_kind.way()


RADIUS, TRACK = PIONEER_WHEELS.radius_m, PIONEER_WHEELS.track_m


@dataclass(frozen=True, slots=True)
class Circling:
    """A body that goes round with speed u and turn w, and slides left, from `start_ns` on."""

    u: float
    w: float
    side: float = 0.0
    start_ns: int = 0
    end_ns: int = 10**10

    @property
    def breaks_ns(self) -> Array:
        return np.array([float(self.start_ns)])

    def at(self, t_ns: Array) -> Kinematics:
        t, still = np.asarray(t_ns) / 1e9, np.zeros(len(t_ns))
        velocity, turn = np.array([self.u, self.side, 0.0]), np.array([0.0, 0.0, self.w])
        poses = level(self.u * np.sin(self.w * t), still, self.w * t)
        rows = [np.tile(v, (len(t), 1)) for v in (velocity, turn, np.cross(turn, velocity), 0 * turn)]
        return Kinematics(poses, *rows)


def test_on_a_circle_each_wheel_goes_round_its_own() -> None:
    t_ns = np.array([0, 1, 10**9, 3 * 10**9 + 7])
    rims = rolled(Circling(0.5, 0.8), t_ns, PIONEER_WHEELS)
    expected = (0.5 + 0.8 * TRACK / 2 * np.array([-1, 1])) / RADIUS * t_ns[:, None] / 1e9
    np.testing.assert_allclose(rims, expected, atol=1e-12)


def test_backwards_they_roll_back_and_on_the_spot_against_each_other() -> None:
    ahead, back = (rolled(Circling(u, 0.0), np.array([10**9]), PIONEER_WHEELS) for u in (0.4, -0.4))
    np.testing.assert_array_equal(back, -ahead)
    left, right = rolled(Circling(0.0, 1.0), np.array([10**9]), PIONEER_WHEELS)[0]
    assert left == -right == pytest.approx(-TRACK / 2 / RADIUS)


def test_a_slide_to_the_side_turns_no_wheel() -> None:
    assert not rolled(Circling(0.0, 0.0, side=0.7), np.array([10**9]), PIONEER_WHEELS).any()


def test_they_stand_at_zero_at_the_start_wherever_the_first_instant_asked_is() -> None:
    early, late = Circling(0.5, 0.8), Circling(0.5, 0.8, start_ns=5 * 10**8)
    t_ns = np.array([10**9, 2 * 10**9])
    np.testing.assert_allclose(
        rolled(late, t_ns, PIONEER_WHEELS), rolled(early, t_ns - 5 * 10**8, PIONEER_WHEELS), atol=1e-12
    )


def test_before_the_start_they_have_yet_to_turn_there() -> None:
    rims = rolled(Circling(0.5, 0.0, start_ns=10**9), np.array([0, 10**9, 2 * 10**9]), PIONEER_WHEELS)
    np.testing.assert_allclose(rims[:, 0] * RADIUS, [-0.5, 0.0, 0.5], atol=1e-12)


def test_of_a_drive_without_slip_they_are_the_rims_that_its_own_equations_turned() -> None:
    run = drive([(0.5, 0.3), (0.2, -0.4)], rate_hz=25.0, substeps=20)
    np.testing.assert_allclose(rolled(run.motion, run.encoder_t_ns, PIONEER_WHEELS), run.rim_rad, atol=1e-9)


def test_with_four_sub_steps_they_are_as_near_as_the_integrator() -> None:
    run = drive([(0.5, 0.3), (0.2, -0.4)])
    np.testing.assert_allclose(rolled(run.motion, run.t_ns, PIONEER_WHEELS), run.rim_rad[::4], atol=1e-7)


def test_no_instant_no_angle() -> None:
    assert rolled(Circling(0.5, 0.8), np.array([], np.int64), PIONEER_WHEELS).shape == (0, 2)


KNOTS = np.linspace(0, 2 * np.pi, 2049)


def test_a_circle_has_its_circumference_and_even_parameter():
    arc = arc_length(lambda phi: np.full_like(phi, 3.0), KNOTS)
    assert arc.length == pytest.approx(6 * np.pi, rel=1e-14)
    s = np.linspace(0, arc.length, 100)
    np.testing.assert_allclose(arc.parameter(s), s / 3, atol=1e-13)


@pytest.mark.parametrize("narrow", [0.9, 0.5, 0.2])
def test_an_ellipse_has_the_length_of_its_elliptic_integral(narrow):
    def speed(phi):
        return np.hypot(np.sin(phi), narrow * np.cos(phi))

    arc = arc_length(speed, KNOTS)
    assert arc.length == pytest.approx(4 * ellipe(1 - narrow**2), rel=1e-13)
    s = np.linspace(0, arc.length, 1000)
    np.testing.assert_allclose(arc.parameter(s, 1) * speed(arc.parameter(s)), 1, atol=1e-9)


@dataclass(frozen=True, slots=True)
class Swaying(Circling):
    """The same, at a speed that comes and goes each second."""

    def at(self, t_ns: Array) -> Kinematics:
        even, t = Circling.at(self, t_ns), np.asarray(t_ns) / 1e9
        return replace(even, velocity_mps=even.velocity_mps * np.sin(2 * np.pi * t)[:, None] ** 2)


def test_how_far_wheels_have_rolled_does_not_hang_on_how_often_it_is_asked() -> None:
    seldom, often = np.array([0, 37 * 10**8]), np.arange(0, 37 * 10**8 + 1, 10**7)
    rims = [rolled(Swaying(0.5, 0.8), t_ns, PIONEER_WHEELS)[-1] for t_ns in (seldom, often)]
    np.testing.assert_allclose(rims[0], rims[1], rtol=1e-11)
    distance_m = 0.5 * (3.7 / 2 - np.sin(4 * np.pi * 3.7) / (8 * np.pi))
    assert RADIUS * rims[0].mean() == pytest.approx(distance_m, rel=1e-11)


@pytest.mark.parametrize("ratio", [(1, 4), (4, 1), (2, 3)])
def test_the_arc_length_of_a_curve_has_knots_for_the_wave_that_is_fastest(ratio) -> None:
    curve = lissajous_curve((3.0, 2.0), ratio, phase_rad=0.1)
    assert len(curve.arc.parameter.c) == 4096 * max(ratio) + 1
