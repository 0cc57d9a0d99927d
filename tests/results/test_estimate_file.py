"""The files of an estimate are read back as they were written."""

import csv
import io
import zipfile

import numpy as np
import pytest

from vobench.errors import TrajectoryError
from vobench.results import estimate_file
from vobench.results.estimate_file import FrameRow, read_tum


def test_rows_survive_commas_quotes_and_other_alphabets(tmp_path):
    rows = [
        FrameRow(0, 0, "init", "", "{}", 1.25, 0.5),
        FrameRow(1, 33_333_333, "lost", 'zu dunkel, "é"', '{"a": 1}', 2.0, 0.125),
    ]
    with (tmp_path / estimate_file.FRAMES).open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows([FrameRow.columns(), *(row.as_text() for row in rows)])
    assert estimate_file.read_frames(tmp_path) == rows


def test_tracks_come_back_in_the_order_of_frames(tmp_path):
    tables = {index: np.full((index, 5), index, np.float32) for index in (2, 10, 100)}
    with zipfile.ZipFile(tmp_path / estimate_file.TRACKS, "w") as archive:
        for index, table in tables.items():
            buffer = io.BytesIO()
            np.save(buffer, table)
            archive.writestr(estimate_file.tracks_member(index), buffer.getvalue())
    read = list(estimate_file.read_tracks(tmp_path))
    assert [index for index, _ in read] == [2, 10, 100]
    assert all(np.array_equal(table, tables[index]) for index, table in read)


def test_an_outcome_with_an_unknown_key_is_refused(tmp_path):
    (tmp_path / estimate_file.OUTCOME).write_text('{"kind": "finished", "reason": "", "mood": "good"}')
    with pytest.raises(ValueError, match="mood"):
        estimate_file.read_outcome(tmp_path)


def test_a_trajectory_with_bytes_of_no_text_is_one_sentence_with_its_place(tmp_path):
    (tmp_path / "a.tum").write_bytes(b"0 0\xff")
    with pytest.raises(TrajectoryError, match=r"^not a text file in UTF-8 \(byte 3\): .*a\.tum$"):
        read_tum(tmp_path / "a.tum")
