"""A PNG is written to an existing folder alone."""

import pytest

from vobench.cli.png_file import require_png
from vobench.errors import InputError


def test_a_png_in_an_existing_folder_is_accepted_even_if_it_exists(tmp_path):
    require_png(tmp_path / "a.png")
    (tmp_path / "a.png").touch()
    require_png(tmp_path / "a.png")


@pytest.mark.parametrize("name", ["a.jpg", "a", "none/a.png", "folder.png"])
def test_anything_else_is_refused(tmp_path, name):
    (tmp_path / "folder.png").mkdir()
    with pytest.raises(InputError, match=r"^--out should be a \.png in an existing folder, got "):
        require_png(tmp_path / name)
