"""End with 0 if every trial of a run has an estimate, else name those without: python board.py RUN_FOLDER."""

import json
import sys
from pathlib import Path


def main(folder: Path) -> None:
    """Read the board of a run and require the status `ok` of each trial."""
    board = json.loads((folder / "leaderboard.json").read_text(encoding="utf-8"))
    cells = board["cells"]
    failed = [cell for cell in cells if cell["status"] != "ok"]
    for cell in failed:
        print(f"{cell['case']}: {cell['estimator']}: {cell['status']}: {cell['reason']}", file=sys.stderr)
    if failed or not cells:
        raise SystemExit(f"{len(failed)} of {len(cells)} trials of {folder} failed")
    print(f"{len(cells)} of {len(cells)} trials of {folder} are ok")


main(Path(sys.argv[1]))
