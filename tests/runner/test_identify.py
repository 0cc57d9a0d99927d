"""Theta comes back from what was driven with it."""

import numpy as np
import pytest

from tests.runner.conftest import CLOSET
from vobench.errors import InputError
from vobench.geometry.rig import PIONEER_WHEELS
from vobench.motion.motor import MotorConstants, theta_of
from vobench.runner.drive import drive_plan
from vobench.runner.identify import identify_drives, read_csv_log
from vobench.suite.suite import read_plan

SUITE = """
name: driven
scenes: [closet]
rigs: {down: {pitch_deg: 90, forward_m: 0}}
trajectories:
  legs: {targets_m: [[0.3, 0.2], [-0.2, 0.3], [0, 0]], tolerance_m: 0.02, slip: none, encoders: exact, KEYS}
estimators: [stand_still]
"""
LAGS_AND_GAINS = ["t1", "t2", "t4", "t6"]


@pytest.fixture
def driven(tmp_path):
    """Writes the drive of the suite, with keys for its trajectory, as a CSV file."""

    def write(keys):
        (tmp_path / "closet.yaml").write_text(CLOSET)
        (tmp_path / "driven.yaml").write_text(SUITE.replace("KEYS", keys))
        (drive,) = drive_plan(read_plan(str(tmp_path / "driven.yaml"))).drives
        (tmp_path / "drive.csv").write_text(drive.csv())
        return tmp_path / "drive.csv"

    return write


def test_the_theta_of_the_motors_comes_back_from_the_csv_of_a_drive(driven):
    expected = theta_of(MotorConstants(m_kg=20, kPT_Vspm=30))
    (found,) = identify_drives(driven("motors: {m_kg: 20, kPT_Vspm: 30}")).drives
    for name in LAGS_AND_GAINS:
        assert getattr(found.fit.theta, name) == pytest.approx(getattr(expected, name), rel=0.02)
    assert found.driven_theta is None  # a CSV file does not state it


def test_wheels_of_another_radius_are_another_theta(driven):
    path = driven("robot_spread: 0")
    usual, smaller = (
        identify_drives(path, radius_m=scale * PIONEER_WHEELS.radius_m).drives[0].fit.theta for scale in (1, 0.5)
    )
    # Half the speed for the same reference: the gain from reference to speed is half as large.
    assert smaller.t4 == pytest.approx(2 * usual.t4, rel=1e-3)


def test_the_table_has_one_row_per_drive_with_the_six_parameters(driven):
    found = identify_drives(driven("robot_spread: 0"))
    (row,) = found.to_frame().to_dict("records")
    theta = found.drives[0].fit.theta
    assert row["t1"] == theta.t1
    assert row["condition"] == found.drives[0].fit.condition
    assert found.as_dict()["drives"][0]["theta"]["t6"] == theta.t6
    assert found.as_dict()["untold"] == {}


def test_the_log_of_a_csv_has_the_rims_and_references_of_the_drive(driven):
    path = driven("robot_spread: 0")
    log = read_csv_log(path, PIONEER_WHEELS)
    columns = np.genfromtxt(path, delimiter=",", names=True)
    np.testing.assert_array_equal(log.rim_rad[:, 1], columns["right_rim_rad"])
    np.testing.assert_array_equal(log.references[:, 0], columns["u_ref_mps"])
    assert log.name == "drive.csv"


def test_stamps_should_increase_if_only_by_a_nanosecond(tmp_path):
    def write(*stamps_ns):
        rows = [f"{t_ns},0,0,0,0" for t_ns in stamps_ns]
        path = tmp_path / "drive.csv"
        path.write_text("\n".join(["t_ns,left_rim_rad,right_rim_rad,u_ref_mps,omega_ref_radps", *rows]))
        return path

    log = read_csv_log(write(5, 6, 7), PIONEER_WHEELS)
    assert log.t_ns.tolist() == [5, 6, 7]
    with pytest.raises(InputError, match="t_ns should increase"):
        read_csv_log(write(5, 6, 6), PIONEER_WHEELS)


def test_every_case_of_a_run_is_identified_beside_the_theta_that_drove_it(first):
    found = identify_drives(first.path)
    assert [drive.name for drive in found.drives] == ["dim", "full"]
    assert found.drives[0].driven_theta is not None
    assert found.drives[0].fit == found.drives[1].fit  # lights move no wheels


def test_a_run_whose_bodies_are_no_pioneers_says_so_of_each_case(bench):
    run = bench.run(("tolerance_m: 0.03, rate_hz: 5", "leg_s: 0.5, rate_hz: 4, mover: unicycle"))
    with pytest.raises(InputError) as raised:
        identify_drives(run.path)
    assert str(raised.value).startswith("dim: a drive to identify is one of mover pioneer")
    assert "; full: " in str(raised.value)


def test_the_wheels_of_a_sequence_cannot_be_given(first):
    with pytest.raises(InputError, match="are for a CSV file"):
        identify_drives(first.path, track_m=0.4)
