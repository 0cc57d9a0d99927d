"""Finds ground truth in the folders that an estimator may read, so that the sandbox can hide it.

An estimator may read its own folder, Python's folders and those that the user has opened. A run, a cache or a recording
can lie in one of them, and would tell the estimator the answer. Therefore these folders are searched before an
estimator starts, by the names of files. Links are not followed, because their targets are not readable.
"""

import os
import re
from collections.abc import Collection, Iterable, Iterator
from functools import cache
from pathlib import Path
from zipfile import BadZipFile, ZipFile

from vobench.estimator import isolation
from vobench.estimator.program import EstimatorFailure
from vobench.estimator.readable_folders import folders_opened_by_user, is_switched_off, python_folders
from vobench.runner.folder import PAGE, SUITE

MOST_ENTRIES = 1_000_000  # the largest number of files and folders that are searched, which takes about 2 s
# Folders with code that was installed or is managed by a tool. They are large, and nobody keeps recordings in them.
INSTALLED = frozenset({".git", "__pycache__", "dist-packages", "node_modules", "pkgs", "site-packages"})
CASES = "cases"
OF_RUN = {CASES, SUITE}
OF_STORE = {"sequences", "state"}
# The entries of a run and of a store that tell the truth or somebody else's answers.
TELLING = {CASES, PAGE, "sequences", "estimates", "scores"}
BUNDLE_MEMBER = "sequence_hashes.json"
BUNDLE_SUFFIX = ".zip"
# Trajectories that vobench writes, among them the truth of runs, and recordings of the viewer, which contain it.
OF_VOBENCH = (r"[^/]*/[^/]*\.tum", r"[^/]*/[^/]*\.rrd")


def visible_truth(estimator_folder: Path, known: Collection[Path]) -> list[Path]:
    """The files and folders with ground truth below the folders that an estimator may read.

    `known` are the real paths of files and folders that are hidden in any case, and therefore not searched.
    Raises EstimatorFailure if the estimator's folder itself is to be hidden, or if a folder holds more than
    MOST_ENTRIES files and folders.
    """
    if is_switched_off():
        return []
    _require_apart(estimator_folder.resolve(), known)
    skipped = {str(path) for path in known}
    found = list[Path]()
    for folder in _searched_folders(estimator_folder):
        found += _search(folder, skipped)
    return found


def _require_apart(estimator_folder: Path, known: Collection[Path]) -> None:
    """Raise EstimatorFailure if the folder of an estimator, which it may read, cannot be told from what is hidden.

    It is itself one of the `known` hidden paths, or it lies in a run or a cache.
    """
    if estimator_folder in known:
        raise EstimatorFailure(
            "refused",
            "its folder is also that of runs, the cache or a recording, which contain ground truth; "
            f"choose another one for them: {estimator_folder}",
        )
    for folder in (estimator_folder, *estimator_folder.parents):
        names = {entry.name for entry in _entries(str(folder))}
        if names >= OF_RUN or names >= OF_STORE:
            place = "a run" if names >= OF_RUN else "a cache"
            raise EstimatorFailure("refused", f"its folder lies in {place}, which contains ground truth: {folder}")


def _searched_folders(estimator_folder: Path) -> list[str]:
    """The real paths of the folders to search: all that are readable, except those of the system."""
    folders = [str(estimator_folder), *folders_opened_by_user(), *python_folders()]
    real_folders = list(dict.fromkeys(os.path.realpath(folder) for folder in folders))
    systems = [os.path.realpath(folder) for folder in isolation.SYSTEM]
    return [folder for folder in real_folders if not _is_below(folder, systems)]


def _is_below(path: str, folders: Iterable[str]) -> bool:
    """Whether a path is one of the folders, or in one of them."""
    return any(f"{path}/".startswith(f"{folder}/") for folder in folders)


def _search(top: str, skipped: Collection[str]) -> Iterator[Path]:
    """The files and folders with ground truth below a folder. Raises EstimatorFailure if it is too large."""
    to_search = [top]
    count = 0
    while to_search:
        folder = to_search.pop()
        entries = _entries(folder)
        count += len(entries)
        if count > MOST_ENTRIES:
            raise EstimatorFailure(
                "refused",
                f"it may read a folder with more than {MOST_ENTRIES} files, too many to be searched for ground truth; "
                f"use a smaller one: {top}",
            )
        is_result = _is_result(entries)
        if is_result and folder != top:
            yield Path(folder)
            continue
        for entry in entries:
            if _holds_truth(entry, os.path.basename(folder), is_in_result=is_result):
                yield Path(entry.path)
            elif _is_searched(entry, skipped):
                to_search.append(entry.path)


def _is_result(entries: Iterable["os.DirEntry[str]"]) -> bool:
    """Whether a folder with these entries is a run or a cache."""
    names = {entry.name for entry in entries}
    return names >= OF_RUN or names >= OF_STORE


def _holds_truth(entry: "os.DirEntry[str]", parent: str, *, is_in_result: bool) -> bool:
    """Whether a file or a folder holds ground truth, by its name, the name of its folder, or what a bundle contains."""
    if is_in_result and entry.name in TELLING:
        return True
    return bool(_truth_pattern().fullmatch(f"{parent}/{entry.name}")) or _is_bundle(entry)


def _is_searched(entry: "os.DirEntry[str]", skipped: Collection[str]) -> bool:
    """Whether an entry is a folder to search: not a link, not of installed packages, and not skipped."""
    return entry.is_dir(follow_symlinks=False) and entry.name not in INSTALLED and entry.path not in skipped


def _entries(folder: str) -> list["os.DirEntry[str]"]:
    """The entries of a folder; none if the user cannot read it, because then the estimator cannot read it either."""
    try:
        with os.scandir(folder) as entries:
            return list(entries)
    except OSError:
        return []


def _is_bundle(entry: "os.DirEntry[str]") -> bool:
    """Whether a file is a bundle, which contains the truth of a run."""
    if not entry.name.lower().endswith(BUNDLE_SUFFIX) or not entry.is_file():
        return False
    try:
        with ZipFile(entry.path) as archive:
            return BUNDLE_MEMBER in archive.namelist()
    except (OSError, BadZipFile, NotImplementedError, ValueError):
        return False


@cache
def _truth_pattern() -> re.Pattern[str]:
    """A pattern for the names, as `folder/name`, of files and folders with ground truth in all layouts and in runs."""
    from vobench.dataset.layout import layouts

    patterns = [*OF_VOBENCH, *(layout.truth for layout in layouts().values() if layout.truth)]
    return re.compile("|".join(f"(?:{pattern})" for pattern in patterns), re.IGNORECASE)
