"""vobench import, export, info and verify, as they are typed."""

import shutil

import pytest

from vobench.runner.folder import SEQUENCE


@pytest.fixture
def sequence(ran):
    """The folder of a sequence."""
    return (ran / "latest" / "cases" / "short" / SEQUENCE).resolve()


@pytest.mark.parametrize("form", ["euroc", "kitti", "tum", "ros2"])
def test_what_is_exported_can_be_imported_and_keeps_its_pictures(vobench, sequence, here, form):
    exported = vobench("export", sequence, "out", "--form", form, "--json").json
    assert exported["files"] == sum(path.is_file() for path in (here / "out").rglob("*"))
    assert exported["notes"]
    imported = vobench("import", "out", "back", "--json").json
    assert imported["form"] == form
    frames = vobench("info", sequence, "--json").json["frames"]
    assert vobench("info", "back", "--json").json["frames"] == imported["frames"] == frames


def test_what_is_no_sequence_is_not_exported(vobench, here, ran):
    truth = ran / "latest" / "cases" / "short" / "ground_truth.tum"
    assert "vobench convert converts trajectory files" in vobench("export", truth, "out", "--form", "tum").err
    (here / "empty").mkdir()
    assert "has no sensors.mcap); vobench import creates one" in vobench("export", "empty", "out", "--form", "tum").err


def test_an_import_says_all_that_it_assumed(vobench, sequence):
    vobench("export", sequence, "out", "--form", "kitti")
    said = vobench("import", "out", "back")
    assert "- The body is the left grey camera" in said.out
    assert said.out.endswith("frames (form: kitti): back\n")
    assert "The body is the left grey camera" in vobench("info", "back").out


def test_an_import_of_one_frame_says_frame(vobench, sequence, here):
    vobench("export", sequence, "out", "--form", "kitti")
    for pictures in ("image_0", "image_1"):
        for path in sorted((here / "out" / pictures).iterdir())[1:]:
            path.unlink()
    for name in ("times.txt", "poses.txt"):
        first_line = (here / "out" / name).read_text().splitlines()[0]
        (here / "out" / name).write_text(f"{first_line}\n")
    assert vobench("import", "out", "back").out.endswith("\nimported 1 frame (form: kitti): back\n")


def test_info_names_topics_cameras_truth_and_the_hash(vobench, sequence):
    facts = vobench("info", sequence, "--json").json
    topics = {topic["name"]: topic for topic in facts["files"]["sensors.mcap"]}
    assert topics["/cam_left/image/compressed"]["count"] == facts["frames"]
    assert topics["/cam_left/image/compressed"]["rate_hz"] == pytest.approx(5)
    assert facts["calibration"]["left"]["model"] == "Pinhole"
    assert facts["ground_truth"]["poses"] == facts["frames"]
    assert len(facts["payload_sha256"]) == 64
    assert facts["provenance"]["vobench"]
    assert facts["payload_sha256"] in vobench("info", sequence).out


def test_info_of_one_file_is_of_that_file(vobench, sequence):
    assert list(vobench("info", sequence / "sensors.mcap", "--json").json["files"]) == ["sensors.mcap"]


def test_a_torn_sequence_is_recognised(vobench, sequence, here):
    torn = here / "torn"
    shutil.copytree(sequence, torn)
    whole = (torn / "sensors.mcap").read_bytes()
    (torn / "sensors.mcap").write_bytes(whole[: len(whole) * 2 // 3])
    said = vobench("info", torn)
    assert said.code == 1
    assert "cut off" in said.err


def test_a_sequence_that_was_never_finished_is_recognised(vobench, sequence, here):
    torn = here / "torn"
    shutil.copytree(sequence, torn)
    (torn / "sensors.mcap").rename(torn / "sensors.mcap.part")
    said = vobench("info", torn)
    assert said.code == 1
    assert "was never finished" in said.err


def test_a_run_verifies_and_a_changed_one_does_not(vobench, ran):
    said = vobench("verify", "runs/tiny")
    assert said.code == 0
    assert "score: 2 of 2 unchanged" in said.out
    estimate = ran / "latest" / "cases" / "short" / "estimates" / "stand_still" / "0" / "estimate.tum"
    estimate.write_text(estimate.read_text().replace("0.000000000 0.0 ", "0.000000000 0.1 ", 1))
    said = vobench("verify", "runs/tiny")
    assert said.code == 1
    assert "the file has changed since the run wrote it" in said.out
    assert vobench("verify", "runs/tiny", "--json").json["wrong"] == 2


WRONG = [
    (("import", "nowhere", "out"), "no file or folder at nowhere"),
    (("import", "suites", "out"), "suites"),
    (("import", "suites", "scenes"), "should be a new or empty folder, but exists and is not empty: scenes"),
    (("import", "suites", "out", "--form", "eurok"), "no form named 'eurok'. Did you mean 'euroc'?"),
    (("import", "suites", "out", "--topic", "lft=/a"), "no topic named 'lft'. Did you mean 'left'?"),
    (
        ("export", "suites", "out", "--form", "euroc"),
        "not a vobench sequence (it has no sensors.mcap); vobench import creates one: suites",
    ),
    (("export", "suites", "out", "--form", "eurok"), "eurok"),
    (("verify", "suites"), "not the folder of a run"),
]


@pytest.mark.parametrize(("words", "sentence"), WRONG, ids=[" ".join(words) for words, _ in WRONG])
def test_a_mistake_is_one_line_and_leaves_nothing_behind(vobench, here, words, sentence):
    before = sorted(here.rglob("*"))
    said = vobench(*words)
    assert (said.code, said.out) == (1, "")
    assert sentence in said.err
    assert said.err.count("\n") == 1
    assert sorted(here.rglob("*")) == before
