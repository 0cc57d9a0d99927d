"""What is published in results/ is scored again: nothing is forged, out of place, or too large for a repository."""

from itertools import product
from pathlib import Path
from zipfile import ZipFile

import pytest

from tests.forgery import forger_of
from vobench.report.published import published_boards

RESULTS = Path(__file__).resolve().parents[1] / "results"
BUNDLES = sorted(RESULTS.glob("*/*.zip"))
MOST_BYTES = 300_000
HOMES = (b"/home/", b"/root/", b"/Users/", f"{RESULTS.parent}/".encode())


def named(bundle):
    return f"{bundle.parent.name}/{bundle.name}"


@pytest.fixture(scope="module")
def published():
    with published_boards(results=RESULTS) as boards:
        yield boards


def test_every_bundle_is_right_and_on_the_one_board_of_its_suite(published):
    assert published.refused == ()
    assert [board.apart for board in published.boards] == [""] * len(published.boards)
    shown = [Path(source.file).name for board in published.boards for source in board.sources]
    assert sorted(shown) == sorted(bundle.name for bundle in BUNDLES)


def test_every_suite_has_results_of_the_built_in_estimators():
    suites = {bundle.parent for bundle in BUNDLES}
    assert "quickstart" in {suite.name for suite in suites}
    for suite in suites:
        assert (suite / "builtin.zip").is_file()


def test_no_estimator_leaves_out_a_case_that_others_have(published):
    for shown in published.boards:
        board = shown.board
        cells = {(cell.case, cell.estimator) for cell in board.cells}
        assert cells == set(product(board.cases, board.estimators)), shown.suite
        assert board.unmade == ()


def test_no_label_is_used_twice_on_a_board(published):
    for board in published.boards:
        labels = [label for source in board.sources for label in source.estimators]
        assert [label for label in labels if " of " in label] == []


def test_every_source_names_its_processor_version_and_date(published):
    for board in published.boards:
        for source in board.sources:
            assert source.environment.processors, source.file
            assert source.environment.vobench, source.file
            assert source.environment.date, source.file


@pytest.mark.parametrize("bundle", BUNDLES, ids=named)
def test_a_bundle_is_small_and_does_not_show_where_it_was_made(bundle):
    assert bundle.stat().st_size <= MOST_BYTES
    with ZipFile(bundle) as file:
        for name in file.namelist():
            content = file.read(name)
            assert [home for home in HOMES if home in content] == [], name


@pytest.mark.parametrize("bundle", BUNDLES, ids=named)
def test_the_readme_lists_the_bundle(bundle):
    assert f"`{named(bundle)}`" in (RESULTS / "README.md").read_text(encoding="utf-8")


def test_a_copy_with_one_pose_of_another_estimate_is_refused(tmp_path):
    forger = forger_of(RESULTS / "quickstart" / "builtin.zip")
    trials = [name for name in forger.files if name.endswith("/lk_epipolar/0/estimate.tum")]
    lines = forger.files[trials[0]].splitlines(keepends=True)
    stamp, x_m, *others = lines[-1].split()
    lines[-1] = b" ".join([stamp, f"{float(x_m) + 0.001:.6f}".encode(), *others]) + b"\n"
    forger.files[trials[0]] = b"".join(lines)
    folder = tmp_path / "quickstart"
    folder.mkdir()
    forger.write(folder / "forged.zip")
    with published_boards(results=tmp_path) as boards:
        assert boards.boards == ()
        (sentence,) = boards.refused
    case = trials[0].split("/")[1]
    assert sentence.startswith(f"refused: lk_epipolar on {case}, 0: another score than its run states")
