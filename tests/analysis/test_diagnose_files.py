"""The command of a diagnosis corrects what it found."""

import shlex
from pathlib import Path

import numpy as np
import pytest

from vobench.analysis.diagnose import Finding
from vobench.analysis.diagnose_files import FileDiagnosis, _exchanged, diagnose_files
from vobench.geometry import se3
from vobench.runner.trajectory_pair import TrajectorySource
from vobench.trajectory.trajectory import Trajectory
from vobench.trajectory.tum import format_tum

OPTICAL = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])


def drive(noise_m: float = 0.0) -> Trajectory:
    n, first_ns = 300, 1_403_636_579_763_555_584
    s = np.linspace(0, 6, n) + 0.1 * np.sin(np.linspace(0, 50, n))
    positions_m = np.stack([5 * np.cos(s), 4 * np.sin(s), 0.7 * np.sin(2.5 * s)], -1)
    positions_m += noise_m * np.random.default_rng(1).normal(size=positions_m.shape)
    R = se3.rotation_z(s + 1.5) @ OPTICAL @ se3.rotation_z(0.4 * np.sin(3 * s))
    return Trajectory(first_ns + np.arange(n, dtype=np.int64) * 50_000_000, se3.transform(R, positions_m))


@pytest.fixture
def sources(tmp_path: Path) -> tuple[TrajectorySource, TrajectorySource]:
    """A drive and its estimate, whose axes of position are mirrored."""
    mirrored = drive(noise_m=0.02)
    mirrored.T_world_frame[:, 1, 3] *= -1
    (tmp_path / "gt.tum").write_text(format_tum(drive()))
    (tmp_path / "est.tum").write_text(format_tum(mirrored))
    return TrajectorySource(tmp_path / "gt.tum"), TrajectorySource(tmp_path / "est.tum")


def test_a_finding_comes_with_the_command_that_corrects_it(sources) -> None:
    gt, est = sources
    found = diagnose_files(gt, est)
    assert [finding.fault for finding in found.findings] == ["mirrored_axes"]
    assert shlex.split(found.command) == [
        "vobench", "score", str(gt.path), str(est.path), "--est-as", "positions:x,-y,z",
    ]  # fmt: skip
    content = found.as_dict()
    assert content["findings"][0]["command"] == content["command"] == found.command
    assert found.to_frame()["options"].tolist() == ["--est-as positions:x,-y,z"]


def test_with_the_words_of_the_command_nothing_is_wrong_any_more(sources) -> None:
    gt, est = sources
    (finding,) = diagnose_files(gt, est).findings
    _, word = finding.options
    corrected = diagnose_files(gt, TrajectorySource(est.path, words=(word,)))
    assert (corrected.findings, corrected.command) == ((), None)
    assert corrected.to_frame().empty


def test_how_files_were_read_is_in_the_command(sources) -> None:
    gt, est = sources
    command = diagnose_files(TrajectorySource(gt.path, words=("xyzw",)), est).command
    assert shlex.split(command)[4:] == ["--gt-as", "xyzw", "--est-as", "positions:x,-y,z"]


def test_unrelated_files_get_no_command(sources, tmp_path: Path) -> None:
    other = drive()
    other.T_world_frame[:, :3, 3] = np.random.default_rng(5).normal(size=(300, 3)).cumsum(axis=0)
    other.T_world_frame[:, :3, :3] = np.roll(other.T_world_frame[:, :3, :3], 137, axis=0)
    (tmp_path / "other.tum").write_text(format_tum(other))
    found = diagnose_files(sources[0], TrajectorySource(tmp_path / "other.tum"))
    assert "unrelated" in [finding.fault for finding in found.findings]
    assert found.command is None


def diagnosis(*findings: Finding, **changes) -> FileDiagnosis:
    return FileDiagnosis(TrajectorySource(Path("gt.tum")), TrajectorySource(Path("est.tum")), findings, **changes)


def test_options_exchange_their_sides_with_the_files() -> None:
    options = ("--est-as", "--gt-as", "--t-offset=0.25", "--t-offset=-3", "-a", "xyzw")
    assert [_exchanged(option) for option in options] == [
        "--gt-as", "--est-as", "--t-offset=-0.25", "--t-offset=3", "-a", "xyzw",
    ]  # fmt: skip


def test_swapped_files_are_exchanged_in_the_command_of_that_finding_and_in_that_of_all() -> None:
    offset = Finding("time_offset", "late", (), ("--t-offset=0.25",))
    found = diagnosis(offset, Finding("swapped_inputs", "swapped", ()))
    assert found.command == "vobench score est.tum gt.tum --t-offset=-0.25"
    commands = [finding["command"] for finding in found.as_dict()["findings"]]
    assert commands == ["vobench score gt.tum est.tum --t-offset=0.25", "vobench score est.tum gt.tum"]


def test_notes_warnings_and_files_of_stamps_are_told() -> None:
    found = diagnosis(
        Finding("scale", "large", (), ("-a", "sim3")), times=(Path("times.txt"),), by_frame="by row", notes=("a note",)
    )
    assert found.command == "vobench score gt.tum est.tum -a sim3 --times times.txt"
    facts = found.as_dict()
    assert (facts["warnings"], facts["notes"]) == (["by row"], ["a note"])
    assert diagnosis().as_dict() == {"findings": [], "command": None, "warnings": [], "notes": []}


def test_the_topic_of_a_bag_is_in_the_command() -> None:
    source = TrajectorySource(Path("run.bag"), topic="/odom")
    found = FileDiagnosis(source, TrajectorySource(Path("est.tum")), (Finding("scale", "large", (), ("-a", "sim3")),))
    assert found.command == "vobench score run.bag est.tum --gt-topic /odom -a sim3"
