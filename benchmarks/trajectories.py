"""Draws the sheet of docs/trajectories.md from the suite in it: python benchmarks/trajectories.py [FILE.svg]."""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from vobench.report.drive_plot import drive_log, save_sheet
from vobench.runner.drive import drive_plan
from vobench.suite.suite import read_plan

DOCS = Path(__file__).parents[1] / "docs"


def main() -> None:
    """Drive the first suite of the page, and draw every path."""
    page = (DOCS / "trajectories.md").read_text(encoding="utf-8")
    with TemporaryDirectory() as folder:
        suite = Path(folder) / "ways.yaml"
        suite.write_text(page.split("```yaml\n")[1].split("```")[0], encoding="utf-8")
        plan = read_plan(str(suite))
    out = Path(sys.argv[1]) if len(sys.argv) > 1 else DOCS / "images" / "trajectories.svg"
    save_sheet(out, [drive_log(drive) for drive in drive_plan(plan).drives])
    print(out)


if __name__ == "__main__":
    main()
