"""vobench identify: the theta that was driven comes out of what was recorded."""

import numpy as np
import pytest

from vobench.motion.motor import MotorConstants, theta_of
from vobench.motion.pioneer import THETAS

SUITE = """name: driven
scenes: [closet]
rigs: {it: {pitch_deg: 90, forward_m: 0}}
trajectories:
  legs: {targets_m: [[0.3, 0.2], [-0.2, 0.3], [0, 0]], tolerance_m: 0.02, slip: none, encoders: exact, KEYS}
estimators: [stand_still]
"""


@pytest.fixture
def driven(here):
    """Writes the suite, with keys for its trajectory."""

    def write(keys, more=""):
        (here / "suites" / "driven.yaml").write_text(SUITE.replace("KEYS", keys) + more)

    return write


def test_the_theta_of_the_motors_comes_back_from_a_run_and_from_its_sequence(vobench, driven, here):
    some = "frames: [2, 90]\ncameras: {it: {timing: {drop_share: 0.1}}}\n"
    driven("rate_hz: 8, motors: {m_kg: 20, kPT_Vspm: 30}", some)
    assert vobench("run", "driven").code == 0
    theta = theta_of(MotorConstants(m_kg=20, kPT_Vspm=30))
    for path in ("runs/driven", next((here / "cache" / "sequences").iterdir())):
        (found,) = vobench("identify", path, "--json").json["drives"]
        assert list(found["driven_theta"].values()) == pytest.approx([*map(float, _numbers(theta))])
        lags_and_gains = [0, 1, 3, 5]
        np.testing.assert_allclose(
            np.array(list(found["theta"].values()))[lags_and_gains], _numbers(theta)[lags_and_gains], rtol=0.01
        )
        assert 0 < found["u_ref_rms_mps"] < 5e-3


def test_the_table_of_drive_tells_the_voltage_and_its_csv_the_theta(vobench, driven):
    driven("robot_spread: 0")
    assert vobench("drive", "driven", "--json").json["trajectories"][0]["peak_V"] is None
    vobench("drive", "driven", "-t", "legs", "--csv", "plain.csv")
    (found,) = vobench("identify", "plain.csv", "--json").json["drives"]
    expected = _numbers(THETAS["pioneer_3dx"])[[0, 1, 3, 5]]
    np.testing.assert_allclose(np.array(list(found["theta"].values()))[[0, 1, 3, 5]], expected, rtol=0.02)
    driven("motors: {}")
    assert 0.5 < vobench("drive", "driven", "--json").json["trajectories"][0]["peak_V"] < 12


def test_voltages_are_those_that_turn_into_the_accelerations_that_were_driven(vobench, driven, here):
    driven("motors: {}")
    vobench("drive", "driven", "-t", "legs", "--csv", "it.csv")
    row = np.genfromtxt(here / "it.csv", delimiter=",", names=True)
    motors = MotorConstants()
    # At rest (1) is 2 r v_u = theta_1^0 u'.
    v_u, t1 = (row["left_V"] + row["right_V"])[0] / 2, motors.Ra_ohm / motors.ka_NmpA * (12 * 0.0975**2 + 2 * 0.02)
    assert row["vx_mps"][0] == 0
    assert row["ax_mps2"][0] == pytest.approx(2 * motors.r_m * v_u / t1, rel=1e-9)


def test_a_drive_that_cannot_tell_is_one_line(vobench, here):
    ideal = SUITE.replace("slip: none, ", "").replace("KEYS", "leg_s: 0.5, rate_hz: 4, mover: unicycle")
    (here / "suites" / "driven.yaml").write_text(ideal)
    assert vobench("run", "driven").code == 0
    said = vobench("identify", "runs/driven")
    assert (said.code, said.out) == (1, "")
    assert said.err.startswith("vobench: legs: a drive to identify is one of mover pioneer, and this body is none: ")


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("t_ns,left_rim_rad\n0,0\n", "no right_rim_rad, u_ref_mps, omega_ref_radps in it.csv"),
        ("", "no t_ns, left_rim_rad"),
        ("t_ns,left_rim_rad,right_rim_rad,u_ref_mps,omega_ref_radps\n0,0,0,x,0\n", "should hold a number in each row"),
        ("t_ns,left_rim_rad,right_rim_rad,u_ref_mps,omega_ref_radps\n0,0,0,0,0\n0,0,0,0,0\n", "t_ns should increase"),
        ("t_ns,left_rim_rad,right_rim_rad,u_ref_mps,omega_ref_radps\n0,0,0,0,0\n", "lasts 1 s and three periods"),
    ],
)
def test_a_csv_that_holds_no_drive_is_one_line(vobench, here, text, sentence):
    (here / "it.csv").write_text(text)
    said = vobench("identify", "it.csv")
    assert (said.code, said.out, said.err.count("\n")) == (1, "", 1)
    assert sentence in said.err


def _numbers(theta):
    return np.array([theta.t1, theta.t2, theta.t3, theta.t4, theta.t5, theta.t6])
