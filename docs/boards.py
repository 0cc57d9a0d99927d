"""Print the boards that the documentation shows, so that each figure stands once and says where it comes from.

    python docs/boards.py [RUN]

Rewrites every block between `<!-- board: SUITE -->` and `<!-- end -->` in README.md and docs/*.md with the board of
that suite as a terminal shows it, which ends with processor, versions and date. RUN is a run's folder; without it the
suite is run, into a folder that is removed again. Blocks of other suites than RUN's stay as they are.
"""

import re
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from vobench.report.board_table import SHORT_LEGEND
from vobench.runner.folder import open_run

ROOT = Path(__file__).resolve().parents[1]
BLOCK = re.compile(r"(<!-- board: (?P<suite>[\w-]+) -->\n).*?(<!-- end -->)", re.DOTALL)


def pages(root: Path) -> list[Path]:
    """The pages that may show a board."""
    return [root / "README.md", *sorted((root / "docs").glob("*.md"))]


def shown(text: str) -> list[str]:
    """The suites whose boards a page shows."""
    return [block["suite"] for block in BLOCK.finditer(text)]


def rewritten(text: str, suite: str, board: str) -> str:
    """A page with this board in each of the suite's blocks."""

    def fill(block: re.Match[str]) -> str:
        if block["suite"] != suite:
            return block[0]
        return f"{block[1]}```\n{board}\n```\n{block[3]}"

    return BLOCK.sub(fill, text)


def printed(run: Path) -> str:
    """The board of a run as a terminal shows it, without the legend, which docs/boards.md explains."""
    command = [sys.executable, "-c", "from vobench.cli import main; main()", "report", str(run)]
    text = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    legend = SHORT_LEGEND.split(";")[0]
    lines = [line.rstrip() for line in text.splitlines()]
    begins = next((at for at, line in enumerate(lines) if line.startswith(legend)), len(lines))
    ends = next((at for at, line in enumerate(lines) if line.startswith("Made on ")), len(lines))
    return "\n".join([*lines[:begins], *lines[ends:]]).strip("\n")


def update(root: Path, run: Path) -> list[Path]:
    """Put a run's board into all pages below `root`; those that changed."""
    suite = run.resolve().parent.name
    board = printed(run)
    changed = []
    for page in pages(root):
        before = page.read_text(encoding="utf-8")
        after = rewritten(before, suite, board)
        if after != before:
            page.write_text(after, encoding="utf-8")
            changed.append(page)
    return changed


def main() -> None:
    """Rewrite the blocks of the run that is named, or of all suites that the pages show."""
    if len(sys.argv) > 1:
        for page in update(ROOT, open_run(Path(sys.argv[1])).path):
            print(page)
        return
    suites = {suite for page in pages(ROOT) for suite in shown(page.read_text(encoding="utf-8"))}
    with TemporaryDirectory() as folder:
        for suite in sorted(suites):
            command = [sys.executable, "-c", "from vobench.cli import main; main()", "run", suite, "--out", folder]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
            for page in update(ROOT, open_run(Path(folder) / suite).path):
                print(page)


if __name__ == "__main__":
    main()
