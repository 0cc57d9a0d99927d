"""Draws the images of docs/scenarios.md: `python docs/sheet.py RUN...`, for runs with severities 0, 3 and 5.

Each image is the left one after 30 % of the frames. Where the two cameras differ, left is red and right cyan. Where
time matters, an image is red and the next one cyan.
"""

import json
import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from vobench.sequence import Sequence

STEREO_SCENARIOS = {"baseline", "calib_drift", "desync", "unlike_eyes"}
TIME_SCENARIOS = {"drops", "frame_rate", "repeats", "spin_in_place"}
SEVERITIES = (0, 3, 5)
SHOWN_SHARE = 0.3  # of the frames are before the image
WIDTH_PX = 168
HEIGHT_PX = 112
TITLE_PX = 14
GAP_PX = 6
SHEETS = 2
COLUMNS = 2
QUALITY = 80

Cases = dict[str, dict[int, Path]]  # the folders of cases, by scenario and severity


def case_image(case: Path, scenario: str) -> Image.Image:
    """A small image of a case."""
    frames = list(Sequence.open(case / "sequence").frames())
    shown = int(SHOWN_SHARE * len(frames))
    frame = frames[shown]
    next_frame = frames[min(shown + 1, len(frames) - 1)]
    other = frame.left
    if scenario in STEREO_SCENARIOS:
        other = frame.right
    elif scenario in TIME_SCENARIOS:
        other = next_frame.left
    return Image.fromarray(np.dstack([frame.left, other, other])).resize(
        (WIDTH_PX, HEIGHT_PX), Image.Resampling.LANCZOS
    )


def sheet(cases: Cases) -> Image.Image:
    """Scenarios in columns, each with its name above its images."""
    rows = -(-len(cases) // COLUMNS)
    row_px = HEIGHT_PX + TITLE_PX + GAP_PX
    column_px = len(SEVERITIES) * WIDTH_PX + 2 * GAP_PX
    drawn = Image.new("RGB", (COLUMNS * column_px + (COLUMNS - 1) * GAP_PX, rows * row_px), "white")
    pen = ImageDraw.Draw(drawn)
    font = ImageFont.load_default(size=11)
    for index, (scenario, by_severity) in enumerate(cases.items()):
        column, row = divmod(index, rows)
        left_px = column * (column_px + 2 * GAP_PX)
        top_px = row * row_px
        for place, severity in enumerate(SEVERITIES):
            x_px = left_px + place * (WIDTH_PX + GAP_PX // 2)
            title = f"{scenario} {severity}" if place == 0 else str(severity)
            pen.text((x_px + 1, top_px), title, "black", font)
            drawn.paste(case_image(by_severity[severity], scenario), (x_px, top_px + TITLE_PX))
    return drawn


def cases_of(runs: list[Path]) -> Cases:
    """The cases of the scenarios in some runs, in the order of the scenarios' names."""
    found: Cases = {}
    for run in runs:
        for file in sorted(run.glob("cases/*/case.json")):
            case = json.loads(file.read_text(encoding="utf-8"))
            found.setdefault(case["scenario"], {})[case["severity"]] = file.parent
    return {scenario: found[scenario] for scenario in sorted(found)}


def main() -> None:
    """Draw the sheets of the runs that are named."""
    cases = cases_of([Path(run) for run in sys.argv[1:]])
    scenarios = list(cases)
    for number in range(SHEETS):
        first = number * len(scenarios) // SHEETS
        end = (number + 1) * len(scenarios) // SHEETS
        path = Path(__file__).parent / "images" / f"scenarios_{number + 1}.jpg"
        sheet({scenario: cases[scenario] for scenario in scenarios[first:end]}).save(path, quality=QUALITY)


if __name__ == "__main__":
    main()
