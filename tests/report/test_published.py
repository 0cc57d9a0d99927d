"""Boards of published results: which results share one, and what a board states about where they come from."""

from collections.abc import Mapping
from pathlib import Path

import pytest

from vobench.errors import InputError, UnknownNameError
from vobench.report.published import (
    ONE_MACHINE,
    PublishedBoard,
    PublishedBoards,
    ResultSource,
    _groups,
    boards_text,
    published_boards,
    results_folder,
)
from vobench.runner.environment import Environment, Processor
from vobench.runner.folder import RunFolder
from vobench.runner.submission import Submission


def submission(tmp_path, name, *, suite="one", version="0.1.0", cases: Mapping[str, dict] | None = None):
    """A submission whose folder has no files, and so no true paths to compare."""
    return Submission(
        path=tmp_path / f"{name}.zip",
        folder=RunFolder(tmp_path / name),
        scores=(),
        suite=suite,
        environment=Environment(vobench=version),
        cases=cases or {"down": {"name": "down"}},
        recordings={},
    )


def shown(suite, *sources, apart=""):
    from vobench.report.leaderboard import make_board

    board = make_board([], {}, title=suite)
    return PublishedBoard(suite, board, tuple(sources), apart, "", RunFolder(Path("none")), ())


def source(name, *, machine="", recordings=""):
    environment = Environment(vobench="0.1.0", processors=(Processor(f"processor of {name}", "v4"),), timed="alone")
    return ResultSource(f"{name}.zip", (f"{name}_vo",), environment, machine, recordings)


def test_results_of_other_suites_and_other_versions_are_on_other_boards(tmp_path):
    first = submission(tmp_path, "a")
    same = submission(tmp_path, "b")
    newer = submission(tmp_path, "c", version="0.2.0")
    other_suite = submission(tmp_path, "d", suite="two")
    groups = _groups([first, newer, other_suite, same])
    assert [[each.path.stem for each in group.submissions] for group in groups] == [["a", "b"], ["c"], ["d"]]
    assert [bool(group.apart) for group in groups] == [False, True, False]
    assert groups[1].apart.endswith("it was made by vobench 0.2.0, not 0.1.0")
    assert "c.zip is not compared with" in groups[1].apart


def test_results_of_a_third_kind_join_the_board_of_their_own_kind(tmp_path):
    versions = {"a": "1", "b": "2", "c": "2", "d": "1", "e": "3"}
    groups = _groups([submission(tmp_path, name, version=version) for name, version in versions.items()])
    assert [[each.path.stem for each in group.submissions] for group in groups] == [["a", "d"], ["b", "c"], ["e"]]


def test_a_board_names_its_sources_with_processor_and_how_they_were_timed():
    (remark,) = shown("one", source("lk")).with_sources.remarks
    assert remark == "lk_vo: lk.zip, processor of lk (v4), vobench 0.1.0, timed alone"


def test_a_board_of_several_machines_says_that_times_are_not_compared():
    several = shown("one", source("lk", machine="A"), source("pnp", machine="B", recordings="other bytes"))
    assert several.introduction == ["other bytes", ONE_MACHINE]
    assert several.with_sources.remarks[2].startswith("(A) lk_vo: lk.zip")
    assert shown("one", source("lk")).introduction == []


def test_markdown_and_json_have_every_board_and_other_formats_only_one():
    both = PublishedBoards(
        (shown("one", source("lk")), shown("two", source("pnp"), apart="not the same")), ("refused",)
    )
    text = boards_text(both, "md", "ate")
    assert text.index("# one") < text.index("lk.zip") < text.index("# two") < text.index("not the same")
    content = boards_text(both, "json", "ate")
    assert '"refused": [\n  "refused"\n ]' in content
    assert content.count('"suite"') == 2
    with pytest.raises(InputError, match="the format csv has one board, and these are 2: one, two"):
        boards_text(both, "csv", "ate")


def test_an_unknown_suite_and_a_missing_folder_are_sentences(tmp_path):
    (tmp_path / "street").mkdir()
    (tmp_path / "street" / "builtin.zip").touch()
    with pytest.raises(UnknownNameError, match="Did you mean 'street'"), published_boards("streets", results=tmp_path):
        pass
    with pytest.raises(InputError, match="no such folder of results"), published_boards(results=tmp_path / "none"):
        pass


def test_a_file_that_is_no_bundle_is_refused_by_its_name(tmp_path):
    (tmp_path / "street").mkdir()
    (tmp_path / "street" / "bad.zip").write_bytes(b"PK, but not for long")
    with published_boards(results=tmp_path) as published:
        assert published.boards == ()
        (sentence,) = published.refused
    assert sentence.startswith("refused: neither the folder of a run nor a bundle")
    assert sentence.endswith("bad.zip")


def test_the_results_are_beside_the_suites():
    assert results_folder().name == "results"
    assert (results_folder().parent / "suites").is_dir()
