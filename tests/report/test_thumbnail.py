"""Small pictures of frames, until there are enough of them."""

import base64

import cv2
import numpy as np
import pytest

from vobench.report import thumbnail
from vobench.report.practice import PRACTICES
from vobench.report.thumbnail import Thumbnails
from vobench.runner.folder import SEQUENCE, RunFolder
from vobench.sequence import Sequence


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    run = RunFolder(tmp_path_factory.mktemp("run"))
    run.case("down").mkdir(parents=True)
    PRACTICES["drive"].write(run.case("down") / SEQUENCE)
    return run


def decoded(uri):
    data = uri.removeprefix("data:image/jpeg;base64,")
    return cv2.imdecode(np.frombuffer(base64.b64decode(data), np.uint8), cv2.IMREAD_UNCHANGED)


def test_a_thumbnail_is_the_frame_at_a_width(folder):
    small = decoded(Thumbnails(folder).get("down", 3, 64))
    frame = Sequence.open(folder.case("down") / SEQUENCE)[3].left
    assert small.shape == (48, 64)
    expected = cv2.resize(frame, (64, 48), interpolation=cv2.INTER_AREA)
    assert np.abs(small.astype(int) - expected).mean() < 8


def test_colours_keep_their_order():
    red = np.zeros((8, 8, 3), np.uint8)
    red[..., 0] = 255
    picture = cv2.imdecode(np.frombuffer(thumbnail._jpeg(red, 4), np.uint8), cv2.IMREAD_COLOR)
    assert picture.shape == (4, 4, 3)
    blue, green, red_channel = picture.reshape(-1, 3).mean(0)
    assert red_channel > 240
    assert max(blue, green) < 20


def test_a_very_wide_picture_keeps_a_row():
    assert cv2.imdecode(np.frombuffer(thumbnail._jpeg(np.zeros((2, 900), np.uint8), 8), np.uint8), 0).shape == (1, 8)


def test_a_frame_or_a_case_that_is_missing_has_none(folder):
    thumbnails = Thumbnails(folder)
    assert thumbnails.get("other", 0, 64) is None
    assert thumbnails.get("down", 0, 64)


def test_beyond_the_budget_only_known_pictures_are_given(folder, monkeypatch):
    thumbnails = Thumbnails(folder)
    first = thumbnails.get("down", 0, 64)
    monkeypatch.setattr(thumbnail, "MOST_BYTES", 1)
    assert thumbnails.get("down", 1, 64) is None
    assert thumbnails.get("down", 0, 64) == first


def test_the_budget_counts_the_bytes_of_all_pictures(folder, monkeypatch):
    thumbnails = Thumbnails(folder)
    size = len(base64.b64decode(thumbnails.get("down", 0, 64).partition(",")[2]))
    monkeypatch.setattr(thumbnail, "MOST_BYTES", 2 * size)
    again = Thumbnails(folder)
    shown = [again.get("down", index, 64) is not None for index in range(6)]
    assert shown == [True, True, *shown[2:]]
    assert not all(shown)
