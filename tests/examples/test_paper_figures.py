"""The paper's figures are drawn and told, as docs/paper.md shows them."""

import subprocess
import sys
from pathlib import Path

EXAMPLE = Path(__file__).parents[2] / "examples" / "paper_figures.py"


def test_two_pictures_are_drawn_and_a_table_of_four_ways_is_printed(tmp_path):
    command = [sys.executable, str(EXAMPLE), str(tmp_path), "--draws", "2"]
    said = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    assert [line.split("|")[1].strip() for line in said[2:]] == [
        "30 Hz, by tolerance",
        "30 Hz, by the clock",
        "10 Hz, by tolerance",
        "10 Hz, by the clock",
    ]
    smallest_mm = [float(line.split("|")[2].split(",")[0]) for line in said[2:]]
    assert smallest_mm[0] < smallest_mm[3]
    for number in (10, 11):
        picture = (tmp_path / f"paper_figure_{number}.png").read_bytes()
        assert picture.startswith(b"\x89PNG")
        assert len(picture) > 20_000
