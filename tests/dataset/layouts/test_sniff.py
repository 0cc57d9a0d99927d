"""The form of a recording is told by what is in it."""

import struct

import pytest
from mcap.writer import Writer as McapWriter

from vobench.dataset.layout import read, sniff
from vobench.errors import VobenchError


@pytest.mark.parametrize("form", ["euroc", "kitti", "tum", "tartanair"])
def test_a_folder_is_known_by_what_it_holds(scene, tmp_path, form):
    assert sniff(getattr(scene, form)(tmp_path)) == form


def test_a_sequence_of_our_own_by_its_folder_or_its_file(scene, tmp_path, imported):
    folder = imported(scene.kitti(tmp_path / "in"))
    assert sniff(folder) == sniff(folder / "sensors.mcap") == "vobench"
    assert read(folder / "sensors.mcap").frame_count == len(scene.t_ns)


@pytest.mark.parametrize(
    ("start", "form"), [(b"#ROSBAG V2.0\n", "ros1"), (b"SQLite format 3\x00", "ros2"), (b"\x89MCAP0\r\n", "mcap")]
)
def test_a_file_is_known_by_its_first_bytes(tmp_path, start, form):
    (tmp_path / "thing").write_bytes(start + bytes(100))
    assert sniff(tmp_path / "thing") == form


def test_a_folder_one_level_too_high_names_those_below(scene, tmp_path):
    scene.euroc(tmp_path / "V1_01_easy")
    scene.euroc(tmp_path / "V1_02_medium")
    with pytest.raises(VobenchError) as caught:
        sniff(tmp_path)
    said = str(caught.value)
    assert "name one of V1_01_easy (euroc), V1_02_medium (euroc)" in said
    assert said.endswith(str(tmp_path))


def test_two_levels_too_high_is_seen_too(scene, tmp_path):
    scene.kitti(tmp_path / "dataset")
    with pytest.raises(VobenchError, match=r"one of sequences/00 \(kitti\)"):
        sniff(tmp_path / "dataset")


@pytest.mark.parametrize(("part", "whole"), [("mav0/cam0", "mav0"), ("mav0/cam1/data", "mav0")])
def test_a_folder_too_low_names_the_one_above(scene, tmp_path, part, whole):
    folder = scene.euroc(tmp_path / "V1_01_easy")
    with pytest.raises(VobenchError) as caught:
        sniff(folder / part)
    said = f"a part of a recording (euroc), which is {folder / whole}; name that instead of {folder / part}"
    assert str(caught.value) == said


def test_a_folder_of_something_else_says_what_it_has(tmp_path):
    for name in ("notes.txt", "photos"):
        (tmp_path / name).mkdir()
    with pytest.raises(
        VobenchError,
        match=r"none of the forms that are read \(.*a sequence of vobench.*\)\. The folder has notes\.txt, photos: ",
    ):
        sniff(tmp_path)


@pytest.mark.parametrize(("kind", "head"), [("zip", b"PK\x03\x04"), ("tar", b"a".ljust(257, b"\0") + b"ustar")])
def test_an_archive_is_to_be_unpacked(tmp_path, kind, head):
    path = tmp_path / f"V1_01_easy.{kind}"
    path.write_bytes(head + bytes(50))
    with pytest.raises(VobenchError, match=f"a {kind} archive; unpack it"):
        sniff(path)


def test_nothing_at_all(tmp_path):
    with pytest.raises(VobenchError, match="no file or folder at"):
        sniff(tmp_path / "gone")
    (tmp_path / "empty").touch()
    with pytest.raises(VobenchError, match=r"\(MCAP, ROS bag or SQLite\): it is empty"):
        sniff(tmp_path / "empty")


@pytest.mark.parametrize(("profile", "said"), [("", "that names no profile"), ("ros1", "ROS 1 messages"), ("x", "'x'")])
def test_an_mcap_file_of_another_kind_is_told_what_is_read(tmp_path, profile, said):
    with (tmp_path / "a.mcap").open("wb") as stream:
        writer = McapWriter(stream)
        writer.start(profile=profile, library="somebody")
        writer.finish()
    with pytest.raises(VobenchError, match=f"{said}.*supported are MCAP files in ROS 2 form"):
        read(tmp_path / "a.mcap")


def test_an_mcap_header_that_claims_to_be_endless(tmp_path):
    path = tmp_path / "a.mcap"
    path.write_bytes(b"\x89MCAP0\r\n" + struct.pack("<BQI", 1, 2**63, 2**32 - 1) + b"ros")
    with pytest.raises(VobenchError, match="an MCAP file of the profile"):
        read(path)


def test_what_the_system_refuses_to_look_at_is_a_sentence(tmp_path):
    with pytest.raises(VobenchError, match=r"cannot read .*name too long"):
        read(tmp_path / ("x" * 5000))
