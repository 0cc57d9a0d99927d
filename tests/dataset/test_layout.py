"""A layout from outside is a module and an entry point: sniffed, read and written without a touch of vobench."""

import struct
import sys
from collections.abc import Callable, Iterator
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import Writer as McapWriter

from vobench.dataset import layout
from vobench.dataset.export import export
from vobench.dataset.layout import GROUP, layouts, read, sniff, writable
from vobench.errors import InputError, SequenceError, VobenchError
from vobench.geometry.rig import Rig

LENT = '''
"""All of a recording in one frames.npz: stamps, pictures, lens and the left camera's path."""

from dataclasses import replace

import cv2
import numpy as np

from vobench.plugin import (
    Layout,
    PictureStream,
    Pinhole,
    RecordedFrame,
    RecordedPicture,
    Rig,
    Trajectory,
    Views,
    Writing,
    assemble,
    png_frames,
)


def read(folder, options):
    path = folder / "frames.npz"
    with np.load(path) as found:
        t_ns, pictures, lens, T = (found[name] for name in ("t_ns", "pictures", "lens", "T_world_left"))
    height, width = pictures.shape[1:]

    def frames():
        for index, stamp in enumerate(t_ns):
            yield RecordedFrame(int(stamp), (RecordedPicture(f"{path}: {index}", pictures[index]),))

    stream = PictureStream.open(frames)
    rig = Rig(Pinhole(width, height, *lens.tolist()), None, np.eye(4), None)
    return assemble("npz", rig, stream, t_ns, truth=Trajectory(t_ns, T), calibration=str(path))


def write(source, views, folder):
    frames = list(png_frames(source.sequence, views))
    pictures = [cv2.imdecode(np.frombuffer(f.pictures["left"], np.uint8), cv2.IMREAD_UNCHANGED) for f in frames]
    lens = views.rig.left.K[[0, 1, 0, 1], [0, 1, 2, 2]]
    path = source.truth.of_mounted(views.rig.T_body_left)
    np.savez(folder / "frames.npz", t_ns=path.t_ns, pictures=pictures, lens=lens, T_world_left=path.T_world_frame)
    return ["All is in frames.npz."]


def left(rig):
    return Views(replace(rig, right=None, T_body_right=None))


LAYOUT = Layout(
    "npz", "frames.npz", lambda path: (path / "frames.npz").is_file(), read, writing=Writing(write, views=left)
)
TWIN = replace(LAYOUT, name="npz2")
SAME = replace(LAYOUT, name="kitti")
NONE = "a layout"
'''


@pytest.fixture
def install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., None]]:
    """A distribution whose entry points are these values of its module."""
    site = tmp_path / "site"
    site.mkdir()
    (site / "lent_layout.py").write_text(LENT)
    monkeypatch.syspath_prepend(str(site))
    monkeypatch.delitem(sys.modules, "lent_layout", raising=False)

    def lend(*values: str) -> None:
        points = [EntryPoint(value.lower(), f"lent_layout:{value}", GROUP) for value in values]
        monkeypatch.setattr(layout, "entry_points", lambda *, group: points if group == GROUP else [])

    yield lend
    sys.modules.pop("lent_layout", None)


def test_a_layout_from_outside_is_sniffed_read_and_written(
    install: Callable[..., None], make_sequence: Callable[..., Any], rig_of: Callable[..., Rig], tmp_path: Path
) -> None:
    install("LAYOUT")
    made = make_sequence(rig_of())
    exported = export(made.folder, tmp_path / "out", "npz")
    assert {"frames.npz", "camchain.yaml", "NOTES.txt"} <= set(exported.files)
    assert exported.notes[0] == "All is in frames.npz."
    assert "Wheels and encoder readings were left out." in exported.notes
    assert sniff(tmp_path / "out") == "npz"
    found = read(tmp_path / "out")
    assert (found.form, found.rig.left) == ("npz", made.rig.left)
    np.testing.assert_array_equal(found.t_ns, made.t_ns)
    np.testing.assert_array_equal([frame.left for frame in found.frames()], made.left)
    assert found.truth is not None
    np.testing.assert_allclose(found.truth.T_world_frame, made.T_world_left, rtol=0, atol=1e-12)


def test_a_layout_that_reads_back_as_something_else_is_refused_from_outside_too(
    install: Callable[..., None], make_sequence: Callable[..., Any], tmp_path: Path
) -> None:
    install("LAYOUT")
    site = tmp_path / "site" / "lent_layout.py"
    site.write_text(LENT.replace("lens=lens", "lens=lens + 1e-5"))
    with pytest.raises(SequenceError, match="the npz folder, read back, differs from what was exported"):
        export(make_sequence().folder, tmp_path / "out", "npz")


def test_what_two_layouts_take_for_theirs_is_for_the_user_to_say_whatever_was_installed_first(
    install: Callable[..., None], tmp_path: Path
) -> None:
    (tmp_path / "frames.npz").touch()
    said = set()
    for order in (("LAYOUT", "TWIN"), ("TWIN", "LAYOUT")):
        install(*order)
        assert list(layouts())[-2:] == ["npz", "npz2"]
        with pytest.raises(
            InputError, match=r"^the content fits more than one form, npz and npz2; name the one to use: "
        ) as e:
            sniff(tmp_path)
        said.add(str(e.value))
    assert len(said) == 1


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("SAME", r"^two layouts are called 'kitti'; one of them is lent_layout:SAME"),
        ("NONE", r"^lent_layout:NONE should be a Layout, but is str$"),
        ("GONE", r"^the layout lent_layout:GONE does not load \(AttributeError: .*'GONE'\)$"),
    ],
)
def test_a_layout_that_is_none_or_has_another_ones_name_is_a_sentence(
    install: Callable[..., None], value: str, said: str
) -> None:
    install(value)
    with pytest.raises(InputError, match=said):
        layouts()


def test_the_names_of_the_layouts_are_those_of_the_documentation() -> None:
    page = (Path(__file__).parents[2] / "docs/datasets.md").read_text(encoding="utf-8")
    lines = page.splitlines()
    for name in layouts():
        assert any(line.startswith("| ") and f"`{name}`" in line.split("|")[1] for line in lines), name
    assert set(writable()) == {"euroc", "kitti", "tum", "ros2"}


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
