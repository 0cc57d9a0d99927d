"""End with 0 if each trial of a run ran to its end, and most of them are ok: board.py RUN_FOLDER.

The hardest severity of quickstart makes estimators lose frames, or all of them; how many depends on the processor and
the driver that draws. Trials with any other status are named.
"""

import json
import sys
from pathlib import Path

ENDED = ("ok", "partial", "lost")


def main(folder: Path) -> None:
    """Read the board of a run, and require that each trial ran to its end and most of them are ok."""
    board = json.loads((folder / "leaderboard.json").read_text(encoding="utf-8"))
    cells = board["cells"]
    failed = [cell for cell in cells if cell["status"] not in ENDED]
    for cell in failed:
        print(f"{cell['case']}: {cell['estimator']}: {cell['status']}: {cell['reason']}", file=sys.stderr)
    ok = sum(cell["status"] == "ok" for cell in cells)
    if failed or 2 * ok <= len(cells):
        raise SystemExit(f"{len(failed)} of {len(cells)} trials of {folder} failed, {ok} are ok")
    print(f"{ok} of {len(cells)} trials of {folder} are ok")


main(Path(sys.argv[1]))
