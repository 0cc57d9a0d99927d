"""Two runs are compared only if their cases are the same."""

import shutil
from pathlib import Path

import pytest

from tests.cli.conftest import here, one_run, ran
from vobench.errors import InputError
from vobench.report.compare import SAME
from vobench.report.run_comparison import compare_runs
from vobench.runner.folder import open_run
from vobench.runner.frames import GROUND_TRUTH

__all__ = ["here", "one_run", "ran"]


@pytest.fixture
def copied(ran: Path, tmp_path: Path) -> Path:
    """A copy of the run, whose files may be changed."""
    return Path(shutil.copytree(open_run(ran).path, tmp_path / "copy"))


def test_a_copy_of_a_run_is_the_same_without_regressions_or_notes(ran, copied):
    notes = list[str]()
    comparison = compare_runs(ran, copied, notes.append)
    assert {change.verdict for change in comparison.changes} == {SAME}
    assert (comparison.regressions, comparison.environment_differences, notes) == ([], [], [])


def test_runs_with_different_cases_of_one_name_are_refused(ran, copied):
    (truth,) = copied.glob(f"cases/short/{GROUND_TRUTH}")
    rows = [line.split() for line in truth.read_text().splitlines() if not line.startswith("#")]
    moved = [[row[0], str(float(row[1]) + 1), *row[2:]] for row in rows]
    truth.unlink()  # it can be a link to the original
    truth.write_text("".join(" ".join(row) + "\n" for row in moved))
    with pytest.raises(InputError, match="case 'short' is another one in the new run: its true path differs"):
        compare_runs(ran, copied, lambda _: None)
