from pathlib import Path

import cv2
import numpy as np
import pytest

from vobench.dataset.picture_list import listed_pictures, numbered, partners, picture_files, read_list
from vobench.errors import InputError


def touch(folder: Path, *names: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        (folder / name).touch()
    return folder


def test_a_list_is_stamps_and_names_with_or_without_a_header(tmp_path: Path) -> None:
    path = tmp_path / "data.csv"
    for header in ("#t,name\n", "t,name\n", ""):
        path.write_text(f"{header}5, a.png\n7,b.png\n")
        found = read_list(path, tmp_path, separator=",", unit="ns")
        assert found.t_ns.tolist() == [5, 7]
        assert found.paths == (tmp_path / "a.png", tmp_path / "b.png")
    assert found.at(np.array([1])).paths == (tmp_path / "b.png",)
    path.write_text("1.5 rgb/a.png\n")
    assert read_list(path, tmp_path, separator=None, unit="s").t_ns.tolist() == [1_500_000_000]
    path.write_text("t rgb/a.png\n")
    with pytest.raises(InputError, match=r"data\.csv:1: a row should be a stamp and an image's name, but is 't rgb"):
        read_list(path, tmp_path, separator=None, unit="s")


def test_a_long_row_is_shown_by_its_start(tmp_path: Path) -> None:
    (tmp_path / "l.txt").write_text("x" * 200)
    with pytest.raises(InputError, match=r"but is 'x{80}'$"):
        read_list(tmp_path / "l.txt", tmp_path, separator=None, unit="s")


@pytest.mark.parametrize(
    ("there", "note"),
    [
        ("bcd", "1 of 4 images were dropped because files are missing: 1 at the start. The first is x/data/a.png."),
        ("abc", "1 of 4 images were dropped because files are missing: 1 at the end. The first is x/data/d.png."),
        (
            "ad",
            "2 of 4 images were dropped because files are missing: "
            "2 between others (a gap of up to 3 s). The first is x/data/b.png.",
        ),
        (
            "b",
            "3 of 4 images were dropped because files are missing: 1 at the start, 2 at the end. "
            "The first is x/data/a.png.",
        ),
    ],
)
def test_missing_pictures_are_counted_by_their_place(tmp_path: Path, there: str, note: str) -> None:
    folder = touch(tmp_path / "x" / "data", *(f"{name}.png" for name in there))
    path = tmp_path / "list"
    path.write_text("".join(f"{second} {name}.png\n" for second, name in enumerate("abcd", 1)))
    (found,), notes = listed_pictures((path, folder), separator=None, unit="s")
    assert [file.stem for file in found.paths] == list(there)
    assert notes == (note,)


def test_pictures_are_paired_within_a_limit_and_a_pair_needs_both_files(tmp_path: Path) -> None:
    lists = []
    for name, stamps in (("l", (10, 20, 30, 40)), ("r", (12, 20, 36, 41))):
        folder = touch(tmp_path / name, *(f"{t}.png" for t in stamps if t != 41))
        path = tmp_path / f"{name}.csv"
        path.write_text("".join(f"{t},{t}.png\n" for t in stamps))
        lists.append((path, folder))
    (left, right), notes = listed_pictures(*lists, separator=",", unit="ns", within_ns=2)
    assert left.t_ns.tolist() == [10, 20]
    assert right.t_ns.tolist() == [12, 20]
    assert notes[:2] == (
        "1 left and 1 right images without a partner were dropped.",
        "Stamps of a pair are up to 2 ns apart; the left image's stamp was used for both.",
    )
    assert notes[2].startswith("1 of 3 pairs were dropped because files are missing: 1 at the end.")
    with pytest.raises(InputError, match="no left and right image have stamps within 0 ns of each other in here"):
        partners(left.t_ns, left.t_ns + 1, 0, "here")
    assert partners(left.t_ns, left.t_ns, 0, "here").notes == ()


def test_numbered_pictures_begin_anywhere_and_have_no_gap(tmp_path: Path) -> None:
    left = touch(tmp_path / "l", "0007_left.png", "0008_left.PNG", "notes.txt", "0009_left.jpg")
    right = touch(tmp_path / "r", "7.png", "8.png", "9.png")
    found = numbered(left, right)
    assert [[path.name for path in eye] for eye in found] == [
        ["0007_left.png", "0008_left.PNG", "0009_left.jpg"],
        ["7.png", "8.png", "9.png"],
    ]
    assert numbered(left) == found[:1]
    touch(right, "11.png")
    with pytest.raises(InputError, match=r"an image is missing: .*r/10\.png$"):
        numbered(right)
    touch(left, "0011_left.png")
    with pytest.raises(InputError, match=r"an image is missing: .*l/0010_left\.png$"):
        numbered(left)
    touch(right, "10.png", "010.png")
    with pytest.raises(InputError, match=r"two images have the number 10: "):
        numbered(right)
    with pytest.raises(InputError, match="no numbered PNG or JPEG image in"):
        numbered(touch(tmp_path / "none", "a.png"))


def test_both_cameras_have_the_same_numbers(tmp_path: Path) -> None:
    left = touch(tmp_path / "l", "0.png", "1.png")
    with pytest.raises(InputError, match="2 left and 1 right images; there should be as many of each"):
        numbered(left, touch(tmp_path / "r", "0.png"))
    with pytest.raises(InputError, match="the first left and right images should have the same number"):
        numbered(left, touch(tmp_path / "s", "1.png", "2.png"))


def test_pictures_are_read_again_each_time(tmp_path: Path) -> None:
    paths = []
    for value in (10, 200):
        path = tmp_path / f"{value}.png"
        path.write_bytes(cv2.imencode(".png", np.full((3, 4), value, np.uint8))[1].tobytes())
        paths.append(path)
    stream = picture_files(np.array([5, 6]), paths, paths[::-1])
    assert stream.size_px == (4, 3)
    for _ in range(2):
        frames = list(stream.frames())
        assert [frame.t_ns for frame in frames] == [5, 6]
        assert [int(frame.left[0, 0]) for frame in frames] == [10, 200]
        assert [int(frame.right[0, 0]) for frame in frames if frame.right is not None] == [200, 10]
