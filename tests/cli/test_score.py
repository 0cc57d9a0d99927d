"""vobench diagnose: what it names, the command it gives, and that this command really mends."""

import csv
import io
import json
import shlex
from pathlib import Path

import numpy as np
import pytest

from vobench.geometry import se3
from vobench.runner.consistency import format_covariances
from vobench.trajectory.trajectory import Trajectory, parse_pose_convention
from vobench.trajectory.tum import format_tum

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
    assert vobench("diagnose", "true", "estimated").out.startswith("no fault was found")
    said = vobench("diagnose", "true", "estimated", "--json").json
    assert (said["findings"], said["command"]) == ([], None)


def test_a_finding_has_its_evidence_its_mend_and_a_command(vobench, files):
    (files / "broken").write_text(rewritten((files / "estimated").read_text(), FAULTS["mirrored_axes"]))
    out = vobench("diagnose", "true", "broken").out
    assert out.startswith("mirrored_axes: the axes of the estimate's positions, but not its rotations, are mirrored")
    assert "rotation left after alignment (rms): " in out
    assert " corrected " in out
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
    T = parse_pose_convention(word).apply(drive(noise_m=0.02).T_world_frame)
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
    assert "correction: none" in out
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


# ruff: noqa: E501 - a sentence stands in one line


DATA = Path(__file__).parents[2] / ".." / "shared" / "data"
WITH_DATA_scoring = pytest.mark.skipif(not DATA.is_dir(), reason="no folder ../shared/data with real trajectories")
METRIC = {"id", "name", "unit", "n", "rmse", "mean", "median", "std", "min", "max", "sse", "p95", "p99"}


def drive_scoring(n=200, noise_m=0.0, first_ns=0):
    s = np.linspace(0, 5, n)
    p = np.stack([4 * np.cos(s), 4 * np.sin(s), np.sin(2 * s)], -1)
    p += noise_m * np.random.default_rng(1).normal(size=p.shape)
    return Trajectory(first_ns + np.arange(n, dtype=np.int64) * 50_000_000, se3.transform(se3.rotation_z(s), p))


def kitti(trajectory):
    rows = trajectory.T_world_frame[:, :3].reshape(len(trajectory), 12)
    return "".join(" ".join(map(repr, row)) + "\n" for row in rows.tolist())


def tartanair(trajectory):
    return "".join(line.partition(" ")[2] + "\n" for line in format_tum(trajectory).splitlines())


def euroc(trajectory):
    rows = [line.split()[1:] for line in format_tum(trajectory).splitlines()]
    lines = [",".join([str(t), *p[:3], p[6], *p[3:6]]) for t, p in zip(trajectory.t_ns.tolist(), rows, strict=True)]
    return "\n".join(["#timestamp [ns], p_x, p_y, p_z, q_w, q_x, q_y, q_z", *lines])


@pytest.fixture
def files_scoring(here):
    """The same drive, true and estimated, in every form of text, each under a name that says nothing."""
    for side, trajectory in (("g", drive_scoring()), ("e", drive_scoring(noise_m=0.05))):
        for form in (format_tum, kitti, tartanair, euroc):
            (here / f"{side}.{form.__name__}").write_text(form(trajectory))
    (here / "times").write_text("".join(f"{t / 1e9!r}\n" for t in drive_scoring().t_ns.tolist()))
    return here


def test_the_json_has_every_key_of_the_contract(vobench, files_scoring):
    scored = vobench("score", "g.format_tum", "e.format_tum", "--json").json
    assert {"metrics", "association", "coverage", "alignment", "warnings"} <= scored.keys()
    for metric in scored["metrics"]:
        assert metric.keys() >= METRIC
        assert isinstance(metric["n"], int)
        assert all(np.isfinite(metric[key]) for key in METRIC - {"id", "name", "unit"})
    assert {metric["name"] for metric in scored["metrics"]} >= {
        "ate_trans",
        "ate_rot",
        "rpe_trans",
        "rpe_rot",
        "kitti_t_rel",
        "kitti_r_rel",
    }
    assert {m["unit"] for m in scored["metrics"] if m["name"] in ("ate_rot", "rpe_rot")} == {"deg"}
    assert scored["association"].keys() >= {"pairs", "gt_poses", "est_poses", "max_diff_s"}
    assert scored["association"]["pairs"] == 200
    assert scored["coverage"] == 1.0
    assert scored["alignment"].keys() >= {"kind", "rotation", "translation", "scale", "unobservable"}
    assert np.shape(scored["alignment"]["rotation"]) == (3, 3)
    assert np.shape(scored["alignment"]["translation"]) == (3,)
    assert isinstance(scored["alignment"]["unobservable"], list)
    assert all(isinstance(warning, str) for warning in scored["warnings"])


def test_csv_and_md_say_what_json_says(vobench, files_scoring):
    scored = vobench("score", "g.format_tum", "e.format_tum", "--json").json["metrics"]
    rows = list(csv.DictReader(io.StringIO(vobench("score", "g.format_tum", "e.format_tum", "--csv").out)))
    assert [row["id"] for row in rows] == [metric["id"] for metric in scored]
    assert [float(row["rmse"]) for row in rows] == [metric["rmse"] for metric in scored]
    md = vobench("score", "g.format_tum", "e.format_tum", "--md").out
    assert f"| ate_trans | m | 200 | {scored[0]['rmse']:.6g} |" in md
    assert all(metric["id"] in md for metric in scored)


def test_the_table_shows_every_metric_and_its_identity(vobench, files_scoring):
    scored = vobench("score", "g.format_tum", "e.format_tum", "--json").json["metrics"]
    out = vobench("score", "g.format_tum", "e.format_tum").out
    assert all(metric["id"] in out and f"{metric['rmse']:.6g}" in out for metric in scored)
    assert vobench("score", "g.format_tum", "e.format_tum", "--csv", "--md").code == 2


@pytest.mark.parametrize("gt", ["format_tum", "euroc"])
@pytest.mark.parametrize("est", ["format_tum", "euroc", "kitti", "tartanair"])
def test_every_form_gives_the_same_score_whatever_the_file_is_called(vobench, files_scoring, gt, est):
    times = ("--times", "times") if est in ("kitti", "tartanair") else ()
    expected = vobench("score", "g.format_tum", "e.format_tum", "--json").json["metrics"]
    scored = vobench("score", f"g.{gt}", f"e.{est}", *times, "--json").json["metrics"]
    assert [metric["id"] for metric in scored] == [metric["id"] for metric in expected]
    np.testing.assert_allclose([m["rmse"] for m in scored], [m["rmse"] for m in expected], rtol=1e-9, atol=1e-12)


def test_files_without_stamps_pair_by_row_and_say_so(vobench, files_scoring):
    scored = vobench("score", "g.kitti", "e.tartanair", "--json").json
    assert scored["association"]["pairs"] == 200
    assert scored["warnings"][0].startswith("neither file has stamps: poses are paired by row")


def test_a_sequences_truth_is_ground_truth(vobench, ran):
    sequence = ran / "latest" / "cases" / "short" / "sequence"
    truth = ran / "latest" / "cases" / "short" / "ground_truth.tum"
    for name in (sequence, sequence / "truth.mcap"):
        assert vobench("score", name, truth, "-a", "none", "--json").json["metrics"][0]["max"] < 1e-9
    body = vobench("score", sequence / "truth.mcap", truth, "--gt-topic", "/tf:map.base_link", "--json").json
    assert body["association"]["pairs"] == scored_frames(truth)


def scored_frames(truth):
    return len(truth.read_text().splitlines())


def test_flags_reach_the_settings_and_override_the_preset(vobench, files_scoring):
    words = ("score", "g.format_tum", "e.format_tum", "--json")
    ids = {
        m["name"]: m["id"]
        for m in vobench(
            *words,
            "--like",
            "evo",
            "-a",
            "sim3",
            "-d",
            "0.5",
            "-u",
            "m",
            "--all-pairs",
            "--pairs-from",
            "gt",
            "--t-max-diff",
            "0.02",
            "--t-offset",
            "0.001",
        ).json["metrics"]
    }
    assert ids["rpe_trans"].startswith(
        "rpe.trans.rmse[delta=0.5m; pairs=all/gt; rule=evo; align=sim3; assoc=evo<=20ms; offset=1ms; n="
    )
    plain = {m["name"]: m["id"] for m in vobench(*words, "--like", "evo").json["metrics"]}
    assert "align=none; assoc=evo<=10ms" in plain["ate_trans"]


@pytest.mark.parametrize("tool", ["evo", "kitti", "rpg", "tum", "openvins", "tartanair", "tartanair_mono"])
def test_every_preset_scores(vobench, files_scoring, tool):
    assert vobench("score", "g.format_tum", "e.format_tum", "--like", tool, "--json").code == 0


@pytest.mark.parametrize(
    ("words", "pairs"),
    [
        ((), "delta=1s; pairs=all/est; rule=tum"),
        (("-d", "2"), "delta=2s; pairs=all/est; rule=tum"),
        (("-u", "m"), "delta=1m; pairs=all/est"),
        (("--consecutive",), "delta=1s; pairs=consecutive/est"),
        (("--pairs-from", "gt"), "delta=1s; pairs=all/gt"),
    ],
)
def test_pairs_that_tums_script_does_not_have_are_ours_and_say_so(vobench, files_scoring, words, pairs):
    scored = vobench("score", "g.format_tum", "e.format_tum", "--like", "tum", *words, "--json").json
    assert f"rpe.trans.rmse[{pairs}; align=se3;" in {m["name"]: m["id"] for m in scored["metrics"]}["rpe_trans"]


@pytest.mark.parametrize(
    ("words", "pairs"),
    [
        ((), "pairs=all/gt; rule=tartanair"),
        (("-d", "2"), "delta=2f; pairs=all/gt"),
        (("--consecutive",), "delta=1f; pairs=consecutive/gt"),
    ],
)
def test_pairs_that_tartanair_does_not_have_are_ours_and_say_so(vobench, files_scoring, words, pairs):
    scored = vobench("score", "g.format_tum", "e.format_tum", "--like", "tartanair", *words, "--json").json
    assert f"rpe.trans.rmse[{pairs}; align=se3;" in {m["name"]: m["id"] for m in scored["metrics"]}["rpe_trans"]


def test_a_plane_is_asked_for_by_name(vobench, files_scoring):
    scored = vobench("score", "g.format_tum", "e.format_tum", "--project", "xy", "--full", "--json").json["metrics"]
    assert next(metric["max"] for metric in scored if metric["name"] == "ate_z") == 0.0
    assert "project=xy;" in scored[0]["id"]


def numbered(text, left_out):
    lines = text.splitlines(keepends=True)
    return "".join(f"{number} {line}" for number, line in enumerate(lines) if number not in left_out)


@pytest.mark.parametrize("times", [(), ("--times", "times")])
def test_kitti_with_frame_numbers_and_frames_missing_is_scored_and_coverage_says_the_rest(
    vobench, files_scoring, times
):
    (files_scoring / "gaps").write_text(numbered((files_scoring / "e.kitti").read_text(), left_out={50, 51}))
    scored = vobench("score", "g.kitti", "gaps", *times, "--json").json
    assert (scored["association"]["pairs"], scored["coverage"]) == (198, 0.99)
    note = "the first of 13 columns was read as the number of a frame (198 poses for frames 0 to 199): gaps"
    assert scored["notes"] == [note]
    (files_scoring / "whole").write_text(numbered((files_scoring / "e.kitti").read_text(), left_out=set()))
    whole, plain = (
        vobench("score", "g.kitti", name, *times, "--json").json["metrics"] for name in ("whole", "e.kitti")
    )
    assert whole == plain
    said = vobench("score", "g.kitti", "gaps", *times)
    assert said.err == f"note: {note}\n"


def test_fewer_rows_than_the_truth_are_stamped_by_a_file_of_times_of_their_own(vobench, files_scoring):
    keep = range(0, 200, 2)
    for name in ("e.kitti", "times"):
        lines = (files_scoring / name).read_text().splitlines(keepends=True)
        (files_scoring / f"half.{name}").write_text("".join(lines[k] for k in keep))
    words = ("g.kitti", "half.e.kitti", "--times", "times", "--times", "half.times")
    assert vobench("score", *words, "--json").json["association"] == {
        "pairs": 100,
        "gt_poses": 200,
        "est_poses": 100,
        "max_diff_s": 0.01,
    }


def test_a_repeated_stamp_is_left_out_and_said_once_beside_the_numbers(vobench, files_scoring):
    lines = (files_scoring / "e.format_tum").read_text().splitlines(keepends=True)
    (files_scoring / "twice").write_text("".join([*lines[:7], lines[6], *lines[7:]]))
    expected = vobench("score", "g.format_tum", "e.format_tum", "--json").json
    note = "rows that repeat the stamp of the row before were left out: 1 of 201, the first at twice:8"
    scored = vobench("score", "g.format_tum", "twice", "--json").json
    assert (scored["metrics"], scored["notes"], expected["notes"]) == (expected["metrics"], [note], [])
    for form in ((), ("--csv",), ("--md",)):
        said = vobench("score", "g.format_tum", "twice", *form)
        assert said.err == f"note: {note}\n"
        assert "note" not in said.out


def test_each_length_of_path_has_its_row_where_asked_and_always_in_json(vobench, files_scoring):
    words = ("score", "g.format_tum", "e.format_tum", "--like", "rpg")
    rows = vobench(*words, "--json").json["per_length"]
    of_yaw = [row for row in rows if row["name"] == "rel_yaw"]
    assert [row["length_m"] for row in of_yaw] == sorted(row["length_m"] for row in of_yaw)
    assert len(of_yaw) == 5
    of_all = next(m for m in vobench(*words, "--json").json["metrics"] if m["name"] == "rel_yaw")
    assert sum(row["n"] for row in of_yaw) == of_all["n"]
    cut = list(csv.DictReader(io.StringIO(vobench(*words, "--csv", "--per-length").out)))
    assert [float(row["rmse"]) for row in cut if row["name"] == "rel_yaw" and row["length_m"]] == [
        row["rmse"] for row in of_yaw
    ]
    for form in ((), ("--md",)):
        assert f"{of_yaw[2]['rmse']:.6g}" in vobench(*words, "--per-length", *form).out
        assert "length" not in vobench(*words, *form).out.partition("[")[0]


def test_stated_covariances_are_held_against_the_errors(vobench, files_scoring):
    """Errors are those of the pose's own noise; a covariance of a tenth of it claims too much."""
    rng, gt = np.random.default_rng(3), drive()
    e = 0.01 * rng.normal(size=(len(gt), 3))
    R = gt.T_world_frame[:, :3, :3] @ se3.rotation_z(0.001 * rng.normal(size=len(gt)))
    est = Trajectory(gt.t_ns, se3.transform(R, gt.positions_m + e))
    Path("gt.tum").write_text(format_tum(gt))
    Path("est.tum").write_text(format_tum(est))
    honest = np.diag([1e-4] * 3 + [1e-6 / 3] * 3)
    for name, factor in (("honest", 1.0), ("bold", 0.01)):
        Path(f"{name}.txt").write_text(format_covariances((t, factor * honest) for t in gt.t_ns.tolist()))
    found = {
        name: vobench("score", "gt.tum", "est.tum", "--cov", f"{name}.txt", "--json").json
        for name in ("honest", "bold")
    }
    assert found["honest"]["consistency"]["scale_gap"] == pytest.approx(1, rel=0.15)
    assert found["bold"]["consistency"]["scale_gap"] == pytest.approx(10, rel=0.15)
    assert found["bold"]["consistency"]["covered_90"] < 0.05
    assert {"nees_pose", "nees_trans", "nees_rot"} <= {metric["name"] for metric in found["honest"]["metrics"]}
    assert "claims too much: errors are " in vobench("score", "gt.tum", "est.tum", "--cov", "bold.txt").out
    refused = vobench("score", "gt.tum", "est.tum", "est.tum", "--cov", "bold.txt")
    assert "--cov should be given once for each estimate, 2 times (got 1)" in refused.err


def test_covariances_of_odometry_are_held_against_errors_aligned_at_the_first_pose(vobench, files_scoring):
    """An alignment over the whole path would take away most of the drift, and the estimate would claim too little."""
    rng, gt = np.random.default_rng(5), drive()
    steps = 0.02 * rng.normal(size=(len(gt), 3))
    steps[0] = 0
    est = Trajectory(gt.t_ns, se3.transform(gt.T_world_frame[:, :3, :3], gt.positions_m + np.cumsum(steps, axis=0)))
    Path("gt.tum").write_text(format_tum(gt))
    Path("est.tum").write_text(format_tum(est))
    covariances = [(t_ns, np.diag([4e-4 * max(k, 1e-3)] * 3 + [1e-6] * 3)) for k, t_ns in enumerate(gt.t_ns.tolist())]
    Path("drift.txt").write_text(format_covariances(covariances))
    words = ("score", "gt.tum", "est.tum", "--cov", "drift.txt", "--json")
    fitted = vobench(*words).json["consistency"]
    fixed = vobench(*words, "--align", "origin").json["consistency"]
    assert fitted == fixed


def test_several_sequences_have_a_row_each_and_one_for_all_of_their_errors(vobench, files_scoring):
    (files_scoring / "short").write_text(
        "".join((files_scoring / "e.format_tum").read_text().splitlines(keepends=True)[:60])
    )
    words = ("score", "--pairs", "g.format_tum", "e.format_tum", "g.format_tum", "short")
    said = vobench(*words, "--json").json
    assert [(part["gt"], part["est"]) for part in said["sequences"]] == [
        ("g.format_tum", "e.format_tum"),
        ("g.format_tum", "short"),
    ]
    alone = vobench("score", "g.format_tum", "short", "--json").json
    assert said["sequences"][1] == {"gt": "g.format_tum", "est": "short", **alone}
    first, second = (part["metrics"] for part in said["sequences"])
    for one, other, both in zip(first, second, said["pooled"]["metrics"], strict=True):
        assert both["n"] == one["n"] + other["n"]
        assert both["sse"] == pytest.approx(one["sse"] + other["sse"], rel=1e-12)
        assert both["mean"] == pytest.approx((one["n"] * one["mean"] + other["n"] * other["mean"]) / both["n"])
    for form in ((), ("--md",)):
        out = vobench(*words, *form).out
        assert all(f"{part['metrics'][0]['rmse']:.6g}" in out for part in (*said["sequences"], said["pooled"]))
    rows = list(csv.DictReader(io.StringIO(vobench(*words, "--csv").out)))
    assert [row["sequence"] for row in rows] == ["e.format_tum"] * 6 + ["short"] * 6 + ["pooled"] * 6
    assert [row["id"] for row in rows[-6:]] == [metric["id"] for metric in said["pooled"]["metrics"]]


def test_sequences_may_stand_in_a_list_beside_their_files(vobench, files_scoring):
    (files_scoring / "sub").mkdir()
    (files_scoring / "sub" / "list").write_text(
        "# truth and estimate\n../g.format_tum ../e.format_tum\n\n../g.kitti ../e.kitti\n"
    )
    listed = vobench("score", "--list", "sub/list", "--json").json
    given = vobench("score", "--pairs", "g.format_tum", "e.format_tum", "g.kitti", "e.kitti", "--json").json
    assert listed["pooled"] == given["pooled"]
    refused = vobench("score", "--pairs", "g.format_tum", "e.format_tum", "g.kitti")
    assert refused.code == 2
    assert "files in pairs, GT EST, but there are 3" in " ".join(refused.err.split())
    assert vobench("score").code == 2
    assert vobench("score", "g.format_tum").code == 2


def test_several_estimates_of_one_truth_stand_side_by_side(vobench, files_scoring):
    (files_scoring / "short").write_text(
        "".join((files_scoring / "e.format_tum").read_text().splitlines(keepends=True)[:60])
    )
    words = ("score", "g.format_tum", "e.format_tum", "short", "g.format_tum")
    names = list(words[2:])
    found = vobench(*words, "--json").json
    assert list(found) == ["gt", "estimates"]
    assert found["gt"] == "g.format_tum"
    for name, content in zip(names, found["estimates"], strict=True):
        alone = vobench("score", "g.format_tum", name, "--json").json
        assert content == {"est": name, **alone}
    for form in ((), ("--md",)):
        out = vobench(*words, *form).out
        assert "pooled" not in out
        assert all(f"{content['metrics'][0]['rmse']:.6g}" in out for content in found["estimates"])
    rows = list(csv.DictReader(io.StringIO(vobench(*words, "--csv").out)))
    assert [row["estimate"] for row in rows] == [name for name in names for _ in range(6)]


def test_an_estimate_that_gives_up_is_said_to(vobench, files_scoring):
    (files_scoring / "crashed").write_text(
        "".join((files_scoring / "e.format_tum").read_text().splitlines(keepends=True)[:190])
    )
    out = vobench("score", "g.format_tum", "crashed").out
    assert "coverage 0.950, lost-aware score 0.4" in out
    assert "(not survived)" in out
    failed = vobench("score", "g.format_tum", "crashed", "--json").json["failure"]
    assert failed["id"] == "lost.aware.score[fail=0.1; slots=auto; align=se3; assoc=nearest<=10ms; n=190/200]"
    assert failed["lost_aware"] < 0.5


def test_what_a_file_is_said_to_be_is_undone(vobench, files_scoring):
    expected = vobench("score", "g.format_tum", "e.format_tum", "-a", "none", "--json").json["metrics"]
    est = drive_scoring(noise_m=0.05)
    odd = [line.split() for line in format_tum(est).splitlines()]
    (files_scoring / "odd").write_text(
        "".join(
            f"{t} {z} {x} {y} {w} {qz} {qx} {qy}\n"
            for t, (_, x, y, z, qx, qy, qz, w) in zip(est.t_ns.tolist(), odd, strict=True)
        )
    )
    scored = vobench(
        "score",
        "g.format_tum",
        "odd",
        "--est-as",
        "ns",
        "--est-as",
        "wxyz",
        "--est-as",
        "axes:y,z,x",
        "-a",
        "none",
        "--json",
    ).json
    np.testing.assert_allclose([m["rmse"] for m in scored["metrics"]], [m["rmse"] for m in expected], rtol=1e-6)


BROKEN = [
    ("nan", "0 0 0 0 0 0 0 1\n1 nan 0 0 0 0 0 1\n", "bad:2: x should be a finite number, but is 'nan'"),
    ("infinite", "0 0 0 0 0 0 0 1\n1 0 1e400 0 0 0 0 1\n", "bad:2: y should be a finite number, but 1e400 overflows"),
    ("zero quaternion", "0 0 0 0 0 0 0 0\n", "bad:1: the quaternion's norm should be 1 within 0.001, but (0, 0, 0, 0) has 0"),
    ("stamps going back", "1 0 0 0 0 0 0 1\n0 0 0 0 0 0 0 1\n", "bad:2: stamps must increase, but 0 follows 1"),
    ("cut off", "0 0 0 0 0 0 0 1\n1 0 0 0 0", "bad:2: a pose has 8 columns (t x y z qx qy qz qw), this line has 5 (the last row: was the file cut off?)"),
    ("mirrored", "1 0 0 0 0 1 0 0 0 0 -1 0\n", "bad:1: the rotation is mirrored (its determinant is -1): these axes are left-handed, a pose's are right-handed"),
    ("empty", "", "no pose, because the file is empty: bad"),
    ("pointer", "version https://git-lfs.github.com/spec/v1\noid sha256:1\nsize 2\n", "a Git-LFS pointer, not the file itself; fetch it with git lfs pull: bad"),
    ("garbage", b"\x00\x01\xfe garbage", "neither text, nor an MCAP file or ROS bag: bad"),
    ("utf-16", "0 0 0 0 0 0 0 1\n".encode("utf-16"), "neither text, nor an MCAP file or ROS bag: bad"),
    ("no overlap", "1000 0 0 0 0 0 0 1\n", "no pose of the estimate is within 10 ms of a ground-truth pose"),
    ("unstamped", "0 0 0 0 0 0 1\n", "no stamps in bad; name the file that has them with --times"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "content", "sentence"), BROKEN, ids=[name for name, *_ in BROKEN])
def test_what_cannot_be_scored_is_one_sentence(vobench, files_scoring, name, content, sentence):
    (files_scoring / "bad").write_bytes(content if isinstance(content, bytes) else content.encode())
    said = vobench("score", "g.format_tum", "bad")
    assert (said.code, said.out) == (1, "")
    assert said.err.startswith(f"vobench: {sentence}")
    assert said.err.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("g.kitti", "short"), "files without stamps pair by row, but have 200 in g.kitti and 3 in short rows; say which with the frame's number as a column in front (13 columns), or stamp each file with a --times of its own"),
        (("g.kitti", "short", "--times", "times"), "200 stamps in times for 3 poses in short; say which with the frame's number as a column in front (13 columns), or stamp each file with a --times of its own"),
        (("g.kitti", "late"), "frames should be below 200, the number of rows in g.kitti, but there is 200 in late"),
        (("g.kitti", "e.kitti", "--times", "times", "--times", "other"), "one file of times should fit the 200 poses in g.kitti, but times and other do"),
        (("g.kitti", "short", "--times", "times", "--times", "other"), "one file of times should fit the 200 poses in g.kitti, but times and other do"),
        (("--list", "odd"), "odd:2: a line should name a truth and an estimate, but has 3 words"),
        (("--list", "nothing"), "cannot read nothing: No such file or directory"),
        (("g.format_tum", "e.format_tum", "--project", "zx"), "no plane named 'zx'. Known: xy, xz, yz"),
        (("g.format_tum", "e.format_tum", "--like", "tartanair_mono", "-a", "sim3"), "--align: should be se3 with the scale of TartanAir (got 'sim3')"),
        (("g.kitti", "e.kitti", "-u", "s"), "a delta in seconds needs stamps, and neither file has any; name one with --times"),
        (("g.format_tum", "e.format_tum", "--times", "times"), "--times is for files without stamps, but both files have theirs: times"),
        (("g.format_tum", "e.format_tum", "--est-topic", "/a"), "a topic is for a recording, but this is a text file: e.format_tum"),
        (("g.format_tum", "e.format_tum", "--like", "eva"), "no preset named 'eva'. Did you mean 'evo'? Known: evo, kitti, openvins, rpg, tartanair, tartanair_mono, tum"),
        (("g.format_tum", "e.format_tum", "-u", "x"), "no unit named 'x'. Known: d, f, m, r, s"),
        (("g.format_tum", "e.format_tum", "-d", "0"), "--delta: should be greater than 0 (got 0.0)"),
        (("g.format_tum", "e.format_tum", "-d", "inf", "-u", "m"), "--delta: should be a finite number (got inf)"),
        (("g.format_tum", "e.format_tum", "-d", "1.5"), "--delta: should be a whole number of frames (got 1.5)"),
        (("g.format_tum", "e.format_tum", "--align-n", "0"), "--align-n: should be 1 or more (got 0)"),
        (("g.kitti", "e.kitti", "--est-as", "wxyz"), "no quaternions to read as wxyz in e.kitti"),
        (("g.kitti", "e.kitti", "--gt-as", "ns"), "no stamps to read as ns in g.kitti"),
        (("g.format_tum", "e.format_tum", "--pairs-from", "tg"), "no side named 'tg'. Known: est, gt"),
        (("g.format_tum", "e.format_tum", "--t-offset", "inf"), "--t-offset should be -2e+09 to 2e+09 seconds, got inf"),
        (("suites", "e.format_tum"), "neither a sequence, nor a ROS 2 bag: suites"),
    ],
)  # fmt: skip
def test_what_cannot_be_asked_is_one_sentence(vobench, files_scoring, words, sentence):
    (files_scoring / "short").write_text("".join((files_scoring / "e.kitti").read_text().splitlines(keepends=True)[:3]))
    (files_scoring / "late").write_text(f"200 {(files_scoring / 'e.kitti').read_text().splitlines()[0]}\n")
    (files_scoring / "other").write_text("".join(f"{t}\n" for t in range(200)))
    (files_scoring / "odd").write_text("g.kitti e.kitti # fine\ng.kitti e.kitti and\n")
    said = vobench("score", *words)
    assert (said.code, said.out, said.err) == (1, "", f"vobench: {sentence}\n")


def test_one_pose_is_scored_without_inventing_motion(vobench, files_scoring):
    (files_scoring / "one").write_text(format_tum(drive_scoring()).splitlines()[0])
    scored = vobench("score", "g.format_tum", "one", "--json").json
    assert scored["association"]["pairs"] == 1
    assert not any(metric["name"].startswith("rpe") for metric in scored["metrics"])
    assert any("no relative pose error" in warning for warning in scored["warnings"])


def test_positions_too_far_apart_to_square_are_no_number(vobench, files_scoring):
    (files_scoring / "far").write_text("0 1e200 0 0 0 0 0 1\n0.05 -1e200 0 0 0 0 0 1\n")
    said = vobench("score", "g.format_tum", "far", "-a", "none")
    assert (said.code, said.out) == (1, "")
    assert "nan" not in said.err


def halved(row):
    return [row[0], *(repr(0.5 * float(value)) for value in row[1:4]), *row[4:]]


EVO = {
    "--align_origin": ("-a", "origin"),
    "--all_pairs": ("--all-pairs",),
    "--pairs_from_reference": ("--pairs-from", "gt"),
}


def evo_cases():
    if not DATA.is_dir():
        return []
    names = {
        "ape/se3/angle_deg",
        "ape/sim3/trans_part",
        "rpe/m0.5all_ref/trans_part",
        "rpe/m100/angle_deg",
        "ape/se3/tmax0.02",
    }
    cases = json.loads((DATA / "evo_expected.json").read_text())["cases"]
    return [pytest.param(case, id=case["id"]) for case in cases if case["id"].partition("/")[2] in names]


def ours(flags):
    """evo's options in our words, which are nearly the same."""
    words = []
    for word in shlex.split(flags.replace("--t_max_diff", "--t-max-diff")):
        words += EVO.get(word, (word,))
    return ("--like", "evo", *words)


def test_the_scale_is_aligned_by_evos_flags(vobench, files_scoring):
    (files_scoring / "half").write_text(rewritten((files_scoring / "e.format_tum").read_text(), halved))
    by_kind = vobench("score", "g.format_tum", "half", "-a", "sim3", "--json").json
    assert by_kind["alignment"]["scale"] == pytest.approx(2.0, rel=0.1)
    for flags in (("-as",), ("-a", "-s"), ("-vas",)):
        assert vobench("score", "g.format_tum", "half", *flags, "--json").json == by_kind
    rigid = vobench("score", "g.format_tum", "half", "-a", "--like", "evo", "--json").json
    assert rigid["alignment"]["kind"] == "se3"


@WITH_DATA_scoring
@pytest.mark.parametrize("case", evo_cases())
def test_evos_options_give_evos_numbers(vobench, case):
    flags = case["flags"].replace("-r trans_part", "").replace("-r angle_deg", "")
    said = vobench("score", DATA / case["ref"], DATA / case["est"], *ours(flags), "--json").json
    name = f"{'ate' if case['tool'] == 'ape' else 'rpe'}_{'rot' if 'angle_deg' in case['id'] else 'trans'}"
    (metric,) = (metric for metric in said["metrics"] if metric["name"] == name)
    assert metric["n"] == case["n"]
    for key, value in case["stats"].items():
        assert metric[key] == pytest.approx(value, rel=1e-9, abs=1e-9 if key == "min" else 0), key
