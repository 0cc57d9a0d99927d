"""The same request may use its folder again, another may not, and a folder of somebody else is left alone."""

import pytest

from vobench.analysis.request_folder import REQUEST_FILE, claim
from vobench.errors import InputError

REQUEST = {"recording": "drive_3", "place": "office"}


def test_a_new_and_an_empty_folder_are_taken(tmp_path):
    claim(tmp_path, REQUEST)
    claim(tmp_path / "new" / "er", REQUEST)
    assert (tmp_path / REQUEST_FILE).read_text() == (tmp_path / "new" / "er" / REQUEST_FILE).read_text()


def test_the_same_request_goes_on_without_what_it_fills_again(tmp_path):
    claim(tmp_path, REQUEST)
    for name in ("sequences", "runs"):
        (tmp_path / name).mkdir()
    claim(tmp_path, REQUEST, regenerated=("sequences",))
    assert sorted(path.name for path in tmp_path.iterdir()) == [REQUEST_FILE, "runs"]


def test_another_request_is_refused(tmp_path):
    claim(tmp_path, REQUEST)
    with pytest.raises(InputError, match="in use for another request"):
        claim(tmp_path, {**REQUEST, "place": "flat"})


def test_a_folder_with_other_files_is_refused_and_left_alone(tmp_path):
    (tmp_path / "thesis.tex").write_text("precious")
    with pytest.raises(InputError, match="not empty"):
        claim(tmp_path, REQUEST)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]
