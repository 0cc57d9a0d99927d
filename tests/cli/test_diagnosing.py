"""vobench diagnose: what it names, the command it gives, and that this command really mends."""

import shlex
from pathlib import Path

import numpy as np
import pytest

from vobench.geometry import se3
from vobench.trajectory.correction import parse_move
from vobench.trajectory.text import format_tum
from vobench.trajectory.trajectory import Trajectory

TRAJECTORIES = Path(__file__).parents[2] / ".." / "shared" / "data" / "trajectories"
TUM = ("freiburg1_xyz-groundtruth.txt", "freiburg1_xyz-rgbdslam.txt")
WITH_DATA = pytest.mark.skipif(not TRAJECTORIES.is_dir(), reason="no folder ../shared/data with real trajectories")
OPTICAL = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])


def drive(noise_m=0.0):
    n, first_ns = 300, 1_403_636_579_763_555_584
    s = np.linspace(0, 6, n) + 0.1 * np.sin(np.linspace(0, 50, n))
    p = np.stack([5 * np.cos(s), 4 * np.sin(s), 0.7 * np.sin(2.5 * s)], -1)
    p += noise_m * np.random.default_rng(1).normal(size=p.shape)
    R = se3.rotation_z(s + 1.5) @ OPTICAL @ se3.rotation_z(0.4 * np.sin(3 * s))
    return Trajectory(first_ns + np.arange(n, dtype=np.int64) * 50_000_000, se3.transform(R, p))


def rewritten(text, change):
    """A TUM file with each row's fields changed."""
    rows = (line.split() for line in text.splitlines() if not line.startswith("#"))
    return "".join(" ".join(change(row)) + "\n" for row in rows)


def negated(number):
    return number[1:] if number.startswith("-") else f"-{number}"


def optical(row):
    """The same poses of a camera that looks along the body's x axis."""
    T = se3.transform(se3.from_quaternion(np.array(row[4:], float)) @ OPTICAL, np.array(row[1:4], float))
    return [row[0], *row[1:4], *map(repr, se3.to_quaternion(T[:3, :3]).tolist())]


FAULTS = {
    "quaternion_order": lambda row: [*row[:4], row[7], *row[4:7]],
    "axis_swap": lambda row: [row[0], row[2], row[3], row[1], *row[4:]],
    "mirrored_axes": lambda row: [row[0], row[1], negated(row[2]), *row[3:]],
    "body_frame_offset": optical,
    "scale": lambda row: [row[0], *(repr(1000 * float(value)) for value in row[1:4]), *row[4:]],
    "time_offset": lambda row: [f"{float(row[0]) - 1.25:.9f}", *row[1:]],
    "stamp_unit": lambda row: [row[0].replace(".", "").ljust(19, "0"), *row[1:]],
}


def rmse(said, name):
    return next(metric["rmse"] for metric in said.json["metrics"] if metric["name"] == name)


def assert_mended(vobench, gt, est, fault):
    """The one finding is the fault, and its command scores as if there had been none."""
    clean = vobench("score", gt, est, "-a", "sim3", "--json")
    Path("broken").write_text(rewritten(Path(est).read_text(), FAULTS[fault]))
    said = vobench("diagnose", gt, "broken", "--json").json
    assert [finding["fault"] for finding in said["findings"]] == [fault]
    assert said["findings"][0]["command"] == said["command"]
    words = shlex.split(said["command"])
    assert words[:2] == ["vobench", "score"]
    mended = vobench(*words[1:], *(() if fault == "scale" else ("-a", "sim3")), "--json")
    assert rmse(mended, "ate_trans") == pytest.approx(rmse(clean, "ate_trans"), rel=0.1)
    assert rmse(mended, "rpe_rot") < 1.05 * rmse(clean, "rpe_rot")
    assert rmse(mended, "ate_rot") < 1.3 * rmse(clean, "ate_rot")


@pytest.fixture
def files(here):
    """A drive and its estimate."""
    (here / "true").write_text(format_tum(drive()))
    (here / "estimated").write_text(format_tum(drive(noise_m=0.02)))
    return here


@WITH_DATA
@pytest.mark.parametrize("fault", FAULTS)
def test_the_command_mends_a_real_file(vobench, here, fault):
    assert_mended(vobench, *(TRAJECTORIES / name for name in TUM), fault)


def test_nothing_wrong_is_said_in_words_and_as_an_empty_list(vobench, files):
    assert vobench("diagnose", "true", "estimated").out.startswith("nothing wrong was found")
    said = vobench("diagnose", "true", "estimated", "--json").json
    assert (said["findings"], said["command"]) == ([], None)


def test_a_finding_has_its_evidence_its_mend_and_a_command(vobench, files):
    (files / "broken").write_text(rewritten((files / "estimated").read_text(), FAULTS["mirrored_axes"]))
    out = vobench("diagnose", "true", "broken").out
    assert out.startswith("mirrored_axes: the axes of the estimate's positions, but not its rotations, are mirrored")
    assert "rotation left after alignment (rms): " in out
    assert " mended " in out
    assert out.endswith("vobench score true broken --est-as positions:x,-y,z\n")


def test_what_was_already_said_of_the_files_is_in_the_command(vobench, files):
    (files / "broken").write_text(rewritten((files / "estimated").read_text(), FAULTS["stamp_unit"]))
    (files / "odd").write_text(rewritten((files / "broken").read_text(), FAULTS["quaternion_order"]))
    said = vobench("diagnose", "true", "odd", "--est-as", "wxyz", "--json").json
    assert said["command"] == "vobench score true odd --est-as wxyz --est-as ns"


@WITH_DATA
def test_swapped_files_are_put_in_order_by_the_command(vobench, here):
    gt, est = (str(TRAJECTORIES / name) for name in ("KITTI_00_gt.txt", "KITTI_00_ORB.txt"))
    said = vobench("diagnose", est, gt, "--json").json
    assert [finding["fault"] for finding in said["findings"]] == ["swapped_inputs"]
    assert shlex.split(said["command"]) == ["vobench", "score", gt, est]


@WITH_DATA
def test_swapped_files_with_an_offset_get_a_command_that_exchanges_both(vobench, here):
    gt, est = (TRAJECTORIES / name for name in TUM)
    (here / "late").write_text(rewritten(est.read_text(), lambda row: [f"{float(row[0]) + 1.25:.9f}", *row[1:]]))
    said = vobench("diagnose", "late", gt, "--gt-as", "xyzw", "--json").json
    assert [finding["fault"] for finding in said["findings"]] == ["time_offset", "swapped_inputs"]
    words = shlex.split(said["command"])
    assert words[:6] == ["vobench", "score", str(gt), "late", "--est-as", "xyzw"]
    assert words[6].startswith("--t-offset=-1.2")
    mended = vobench(*words[1:], "--json")
    assert rmse(mended, "ate_trans") == pytest.approx(rmse(vobench("score", gt, est, "--json"), "ate_trans"), rel=0.1)


def test_a_mend_of_the_estimate_is_one_of_the_truth_once_they_have_changed_places(vobench, files):
    lines = (files / "true").read_text().splitlines(keepends=True)
    smooth = "".join(rewritten(line, FAULTS["axis_swap"]) for line in lines)
    (files / "smooth").write_text("# ground truth\n" + smooth)
    said = vobench("diagnose", "estimated", "smooth", "--json").json
    assert [finding["fault"] for finding in said["findings"]] == ["axis_swap", "swapped_inputs"]
    assert said["command"].startswith("vobench score smooth estimated --gt-as positions:")
    assert rmse(vobench(*shlex.split(said["command"])[1:], "--json"), "ate_rot") < 5


@pytest.mark.parametrize(("fault", "word"), [("inverse_poses", "inverse"), ("inverse_rotations", "rotations:inverse")])
def test_inverse_poses_and_inverse_rotations_are_mended_by_one_word(vobench, files, fault, word):
    T = parse_move(word).apply(drive(noise_m=0.02).T_world_frame)
    (files / "broken").write_text(format_tum(Trajectory(drive().t_ns, T)))
    said = vobench("diagnose", "true", "broken", "--json").json
    assert [finding["fault"] for finding in said["findings"]] == [fault]
    assert said["command"] == f"vobench score true broken --est-as {word}"
    mended, clean = (
        vobench("score", "true", *words, "--json").json["metrics"]
        for words in (("broken", "--est-as", word), ("estimated",))
    )
    np.testing.assert_allclose([m["rmse"] for m in mended], [m["rmse"] for m in clean], rtol=1e-6, atol=1e-12)


def test_unrelated_files_get_no_command(vobench, files):
    other = Trajectory(drive().t_ns, np.roll(drive().T_world_frame, 137, axis=0)[:, [2, 0, 1, 3]][:, :, [2, 0, 1, 3]])
    T = other.T_world_frame.copy()
    T[:, :3, 3] = np.random.default_rng(5).normal(size=(300, 3)).cumsum(axis=0)
    (files / "other").write_text(format_tum(Trajectory(other.t_ns, T)))
    said = vobench("diagnose", "true", "other", "--json").json
    assert ([finding["fault"] for finding in said["findings"]], said["command"]) == (["unrelated"], None)
    out = vobench("diagnose", "true", "other").out
    assert out.startswith("unrelated: these trajectories are not of one motion")
    assert "mend: none" in out
    assert "vobench score" not in out


def test_what_was_told_of_stamps_and_quaternions_is_believed(vobench, files):
    (files / "ns").write_text(rewritten((files / "true").read_text(), FAULTS["stamp_unit"]))
    (files / "odd").write_text(rewritten((files / "ns").read_text(), FAULTS["quaternion_order"]))
    told = vobench("diagnose", "odd", "estimated", "--gt-as", "ns", "--gt-as", "wxyz", "--json").json
    assert (told["findings"], told["command"]) == ([], None)
    untold = vobench("diagnose", "odd", "estimated", "--json").json
    assert untold["command"] == "vobench score odd estimated --gt-as ns --gt-as wxyz"


def test_files_that_cannot_be_compared_are_one_sentence(vobench, files):
    (files / "few").write_text("".join((files / "true").read_text().splitlines(keepends=True)[:3]))
    said = vobench("diagnose", "true", "few")
    assert (said.code, said.out) == (1, "")
    assert said.err == "vobench: a diagnosis needs 8 matched poses or more, but 3 match\n"
