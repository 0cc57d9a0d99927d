"""Draws the pictures of scenarios.md: `python docs/sheet.py RUN...`, of runs with severities 0, 3 and 5.

Each picture is the left one, a third of the way along. Where eyes differ, left is red and right cyan; where time does,
a picture is red and the one that comes next cyan.
"""

import json
import sys
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from vobench.sequence import Sequence

EYES = {"baseline", "calib_drift", "desync", "unlike_eyes"}
TIME = {"drops", "frame_rate", "repeats", "spin_in_place"}
SEVERITIES = (0, 3, 5)
WIDE = 168
HIGH = 112
HEAD = 14
GAP = 6
SHEETS = 2
COLUMNS = 2
QUALITY = 80


def picture(case: Path, scenario: str) -> Image.Image:
    """A small picture of a case, from a third of its way."""
    frames = list(Sequence.open(case / "sequence").frames())
    now, then = (frames[min(int(0.3 * len(frames)) + n, len(frames) - 1)] for n in (0, 1))
    other = then.left if scenario in TIME else now.left
    if scenario in EYES:
        other = now.right
    return Image.fromarray(np.dstack([now.left, other, other])).resize((WIDE, HIGH), Image.Resampling.LANCZOS)


def sheet(scenarios: dict[str, dict[int, Path]]) -> Image.Image:
    """Scenarios in columns, each with its name above three pictures."""
    rows = -(-len(scenarios) // COLUMNS)
    step = 3 * WIDE + 2 * GAP
    drawn = Image.new("RGB", (COLUMNS * step + GAP * (COLUMNS - 1), rows * (HIGH + HEAD + GAP)), "white")
    pen = ImageDraw.Draw(drawn)
    font = ImageFont.load_default(size=11)
    for nth, (name, cases) in enumerate(scenarios.items()):
        x = nth // rows * (step + 2 * GAP)
        y = nth % rows * (HIGH + HEAD + GAP)
        for place, severity in enumerate(SEVERITIES):
            at = x + place * (WIDE + GAP // 2)
            pen.text((at + 1, y), f"{name} {severity}" if not place else str(severity), "black", font)
            drawn.paste(picture(cases[severity], name), (at, y + HEAD))
    return drawn


found: dict[str, dict[int, Path]] = {}
for file in sorted(file for run in sys.argv[1:] for file in Path(run).glob("cases/*/case.json")):
    said = json.loads(file.read_text())
    found.setdefault(said["scenario"], {})[said["severity"]] = file.parent
names = sorted(found)
for nth in range(SHEETS):
    of = names[nth * len(names) // SHEETS : (nth + 1) * len(names) // SHEETS]
    to = Path(__file__).parent / "images" / f"scenarios_{nth + 1}.jpg"
    sheet({name: found[name] for name in of}).save(to, quality=QUALITY)
