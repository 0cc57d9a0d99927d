"""Packs a run into one zip file that others can score again, and merges several runs."""

import errno
import json
import os
import re
import stat
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from hashlib import sha256
from pathlib import Path, PurePosixPath
from shutil import copyfile
from types import MappingProxyType
from typing import Any
from zipfile import ZIP_DEFLATED, BadZipFile, ZipFile, ZipInfo

import numpy as np

from vobench.errors import InputError, printable
from vobench.runner.consistency import COVARIANCE
from vobench.runner.entry import file_hash
from vobench.runner.environment import merged_environment, read_environment
from vobench.runner.estimate import ESTIMATE, LOG, REVISED
from vobench.runner.folder import (
    CASE,
    ENVIRONMENT,
    ESTIMATES,
    ESTIMATORS,
    HASHES,
    SCORE,
    SEQUENCE,
    SUITE,
    TIMES_HASHES,
    UNTIL,
    RunFolder,
    TrialScore,
    hashes_in,
    open_run,
    read_hashes,
    read_tum,
)
from vobench.runner.frames import FRAMES, GROUND_TRUTH, TIMES
from vobench.runner.rescore import rescored
from vobench.runner.store import Tell, write_json
from vobench.suite.catalog import builtin_root
from vobench.temporary import temporary_folder

OF_RUN = (SUITE, ENVIRONMENT, ESTIMATORS, UNTIL)
OF_CASE = (CASE, GROUND_TRUTH)
OF_TRIAL = (SCORE, ESTIMATE, REVISED, COVARIANCE, FRAMES, TIMES, LOG)
SEQUENCES = "sequence_hashes.json"  # the hashes of the recordings, which are too large for a bundle
RUN = "run.json"  # the name of the run's folder, which has its date
MOST_BYTES = 8 << 30  # the largest size of all files after unpacking
MOST_JSON_BYTES = 64 << 20  # of one file that is read as a whole; parsed, it takes ten times as much memory
MOST_FILES = 500_000
# The form of names in a suite. In merged runs, a label can be followed by the name of its run.
LABEL = re.compile(r"[a-z0-9][a-z0-9_.]*( of [A-Za-z0-9_.-]+)?")
CASE_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]*")
REPEAT = re.compile(r"[0-9]{1,9}")
NO_PLAIN = re.compile(r"[^A-Za-z0-9_.-]|^[^A-Za-z0-9]")
NAME_LETTERS = 60
FOLLOW_NOTHING = os.O_RDONLY | os.O_NOFOLLOW
SAME_POSE = 1e-9  # the largest difference of equal poses, in m and elements of a rotation
EPOCH = (1980, 1, 1, 0, 0, 0)  # the date of all files, so that equal runs give equal bundles


def bundle(folder: RunFolder, out: Path) -> int:
    """Write the suite, versions, truth, estimates, scores and all hashes to a zip file, and return the number of files.

    Raises InputError if the folder is not a run.
    """
    root = folder.path.resolve()
    files = {RUN: json.dumps({"name": root.name}).encode()}
    for name in _bundled_names(folder):
        content = _content(root, name)
        if content is not None:
            is_case = PurePosixPath(name).name == CASE
            files[name] = _with_relative_makers(content) if is_case else content
    hashes = {name: sha256(content).hexdigest() for name, content in files.items()}
    tables = {HASHES: hashes, TIMES_HASHES: {}, SEQUENCES: sequence_hashes(folder)}
    with ZipFile(out, "w", ZIP_DEFLATED) as file:
        for name, table in tables.items():
            file.writestr(ZipInfo(name, EPOCH), json.dumps(table, indent=1), ZIP_DEFLATED)
        for name, content in files.items():
            file.writestr(ZipInfo(name, EPOCH), content, ZIP_DEFLATED)
    return len(files)


def _with_relative_makers(case: bytes) -> bytes:
    """The file of a case in which the paths of included makers do not depend on where vobench is installed."""
    return case.replace(f'"{builtin_root()}/'.encode(), b'"')


def _bundled_names(folder: RunFolder) -> Iterator[str]:
    """The names of the files that a bundle of a run may contain: those of the run, of cases, and of trials."""
    yield from OF_RUN
    trials = [file.parent for file in folder.score_files()]
    cases = sorted({trial.parents[2] for trial in trials})
    for place in (*cases, *trials):
        below = place.relative_to(folder.path)
        for name in (*OF_CASE, *OF_TRIAL):
            yield str(below / name)


def sequence_hashes(folder: RunFolder) -> dict[str, str]:
    """The hashes of the recordings of a run, by file; a bundle lists those to which its run linked.

    Raises InputError if there are no hashes.
    """
    is_unpacked = (folder.path / SEQUENCES).is_file()
    hashes = hashes_in(folder.path / SEQUENCES) if is_unpacked else read_hashes(folder)
    return {name: value for name, value in hashes.items() if SEQUENCE in PurePosixPath(name).parts}


def require_zip(out: Path) -> None:
    """Raise InputError unless the name of a bundle ends in .zip."""
    if out.suffix.lower() != ".zip":
        raise InputError(f"a bundle's name should end in .zip, got {out.name!r}")


def _content(root: Path, name: str) -> bytes | None:
    """The content of a file below a folder, None if it does not exist. No link on its path is followed.

    Raises InputError if a part of its path is a link, or if it is not a file.
    """
    *folders, last = PurePosixPath(name).parts
    opened = [os.open(root, os.O_RDONLY | os.O_DIRECTORY)]
    try:
        for part in folders:
            opened.append(os.open(part, os.O_DIRECTORY | FOLLOW_NOTHING, dir_fd=opened[-1]))
        opened.append(os.open(last, os.O_NONBLOCK | FOLLOW_NOTHING, dir_fd=opened[-1]))
        if not stat.S_ISREG(os.fstat(opened[-1]).st_mode):
            raise InputError(f"only files can be bundled, which this is not: {root / name}")
        with open(opened.pop(), "rb") as file:
            return file.read()
    except FileNotFoundError:
        return None
    except OSError as error:
        if error.errno in (errno.ELOOP, errno.ENOTDIR):
            raise InputError(f"a link is on its path, which a bundle does not follow: {root / name}") from None
        raise
    finally:
        for fd in opened:
            os.close(fd)


@contextmanager
def opened(path: Path, tell: Tell = lambda _: None) -> Iterator[RunFolder]:
    """The run in a folder or a bundle. A bundle is unpacked for the duration of the block.

    `tell` is called with a sentence if control characters had to be removed from the unpacked files. Raises InputError
    if the path is neither, or if the names in it are not valid in a suite.
    """
    if not path.is_file():
        folder = open_run(path)
        _require_names(folder)
        yield folder
        return
    with temporary_folder() as temporary:
        try:
            with ZipFile(path) as file:
                _require_sizes(file, path)
                folder = RunFolder(temporary / _suite(file) / _run_name(file, path))
                names = _unpack(file, folder.path, path)
        except (BadZipFile, NotImplementedError, RuntimeError, EOFError, zlib.error) as error:
            raise InputError(f"neither the folder of a run nor a bundle ({error}): {path}") from None
        hashes = read_hashes(folder)
        for name, held in hashes.items():
            there = folder.path / name
            if not there.is_file() or file_hash(there) != held:
                raise InputError(f"{name} is not the file that was bundled: {path}")
        unnamed = sorted(set(names) - hashes.keys() - {HASHES, TIMES_HASHES, SEQUENCES})
        if unnamed:
            raise InputError(f"contains a file that its hashes do not name ({printable(unnamed[0])}): {path}")
        _require_names(folder)
        for name in hashes:
            if _clean(folder.path / name):
                tell(f"control characters were removed from {name}: {path}")
        yield folder


def _require_names(folder: RunFolder) -> None:
    """Raise InputError if the name of a case or an estimator is not valid in a suite."""
    for file in folder.score_files():
        case = file.parents[3].name
        estimator = file.parents[1].name
        repeat = file.parent.name
        for what, name, pattern in (
            ("case", case, CASE_NAME),
            ("estimator", estimator, LABEL),
            ("repeat", repeat, REPEAT),
        ):
            if not pattern.fullmatch(name):
                shown = printable(name)[:NAME_LETTERS]
                raise InputError(f"the name of its {what} should match {pattern.pattern}, got {shown!r}: {folder.path}")


def _clean(path: Path) -> bool:
    """Remove control characters, such as ESC and those that reverse text, from a table or JSON file.

    Returns whether there were any.
    """
    if path.suffix not in (".json", ".csv"):
        return False
    text = path.read_text(encoding="utf-8", errors="replace")
    cleaned = _clean_table(text) if path.suffix == ".csv" else _clean_json(text, path.name)
    if cleaned == text:
        return False
    path.write_text(cleaned, encoding="utf-8")
    return True


def _clean_table(text: str) -> str:
    """A table in which control characters, except line ends and tabs, are replaced by spaces."""
    return "".join(letter if letter.isprintable() or letter in "\r\n\t" else " " for letter in text)


def _clean_json(text: str, name: str) -> str:
    """JSON in which all texts are made printable; the same text if they are already. Raises InputError."""
    try:
        value = json.loads(text)
        cleaned = _printable(value)
    except (ValueError, RecursionError) as error:
        raise InputError(f"not readable as JSON ({error}): {name}") from None
    return text if cleaned == value else json.dumps(cleaned, ensure_ascii=False)


def _printable(value: Any) -> Any:
    """The JSON value with all texts made printable."""
    if isinstance(value, str):
        return printable(value)
    if isinstance(value, list):
        return [_printable(entry) for entry in value]
    if isinstance(value, dict):
        return {printable(key): _printable(entry) for key, entry in value.items()}
    return value


def _plain_name(name: str) -> str:
    """A name without characters that are unsafe in a table or on a terminal."""
    return NO_PLAIN.sub("_", name)


def _suite(file: ZipFile) -> str:
    """The name of the suite, as a valid name of a folder."""
    try:
        name = str(json.loads(file.read(SUITE))["name"])
    except (KeyError, ValueError, TypeError, RecursionError):
        return "bundle"
    return name if LABEL.fullmatch(name) else "bundle"


def _run_name(file: ZipFile, path: Path) -> str:
    """The name of the run's folder; that of the bundle if an older vobench packed it."""
    try:
        name = str(json.loads(file.read(RUN))["name"])
    except (KeyError, ValueError, TypeError, RecursionError):
        name = path.stem
    return _plain_name(name)[:NAME_LETTERS] or "bundle"


def _require_sizes(file: ZipFile, path: Path) -> None:
    """Raise InputError if there are too many files, or if they are too large.

    The sizes are those that the bundle states. A file that turns out to be larger is not read further.
    """
    entries = file.infolist()
    if len(entries) > MOST_FILES:
        raise InputError(f"contains {len(entries)} files, more than {MOST_FILES}: {path}")
    total = sum(entry.file_size for entry in entries)
    if total > MOST_BYTES:
        raise InputError(f"unpacks to {total / 1e9:.3g} GB, more than {MOST_BYTES / 1e9:.3g}: {path}")
    for entry in entries:
        is_json = PurePosixPath(entry.filename).suffix == ".json"
        if is_json and entry.file_size > MOST_JSON_BYTES:
            name = printable(entry.filename)
            raise InputError(f"contains {name} of {entry.file_size} bytes, more than {MOST_JSON_BYTES}: {path}")


def _unpack(file: ZipFile, to: Path, path: Path) -> list[str]:
    """Unpack all files, and return their names. Raises InputError for a duplicate, or a path outside of the folder."""
    entries = file.infolist()
    seen = set[str]()
    for entry in entries:
        if _is_outside(entry):
            raise InputError(f"contains a file whose path is outside of it ({entry.filename!r}): {path}")
        name = str(PurePosixPath(entry.filename))
        if name in seen:
            raise InputError(f"holds a file twice ({entry.filename!r}): {path}")
        seen.add(name)
    to.mkdir(parents=True)
    file.extractall(to)
    return [str(PurePosixPath(entry.filename)) for entry in entries if not entry.is_dir()]


def _is_outside(entry: ZipInfo) -> bool:
    """Whether an entry is a link, or its path leads out of the folder to which it is unpacked."""
    parts = PurePosixPath(entry.filename).parts
    is_link = stat.S_ISLNK(entry.external_attr >> 16)
    return is_link or ".." in parts or entry.filename.startswith("/")


def scored_again(
    folder: RunFolder, wrong_truths: Mapping[str, str] = MappingProxyType({})
) -> Iterator[tuple[TrialScore, bool]]:
    """Each trial with its score computed again from estimate and truth, and whether the stored score is the same.

    `wrong_truths` are those of `rescored`.
    """
    for trial in rescored(folder, wrong_truths):
        yield trial.score, not (trial.differs or trial.claimed)


@contextmanager
def merged(
    folders: Sequence[RunFolder], names: Sequence[str], labels: Sequence[Mapping[str, str]] | None = None
) -> Iterator[RunFolder]:
    """Several runs merged into one, for the duration of the block.

    Trials with the same label become repeats. `labels` has the label of each estimator in the merged run, one table for
    each run; by default they are those of `pooled_labels`. `names` are those of the runs.
    Raises InputError if two runs have different cases with the same name.
    """
    if len(folders) == 1:
        yield folders[0]
        return
    if labels is None:
        labels = pooled_labels(folders, names)
    with temporary_folder() as temporary:
        together = RunFolder(temporary / "merged" / "runs")
        together.path.mkdir(parents=True)
        _merge_environments(folders, together)
        _copy_first_decision(folders, together)
        for folder, name, label_of in zip(folders, map(_plain_name, names), labels, strict=True):
            for score in folder.scores():
                _link_case(folder, together, score.case, name)
                _link_trial(folder, together, score, label_of[score.estimator])
        yield together


def pooled_labels(folders: Sequence[RunFolder], names: Sequence[str]) -> list[dict[str, str]]:
    """The label of each estimator in a merged run, one table for each run.

    Equal estimators with the same label keep it, so that their trials become repeats. The label of a different
    estimator is followed by the name of its run.
    """
    first_facts: dict[str, Any] = {}  # by the label of an estimator, of the first run that has the label
    tables = []
    for folder, name in zip(folders, map(_plain_name, names), strict=True):
        facts = {entry["label"]: entry for entry in _stated(folder)}
        table = dict[str, str]()
        for score in folder.scores():
            label = score.estimator
            is_same_estimator = first_facts.setdefault(label, facts.get(label)) == facts.get(label)
            table[label] = label if is_same_estimator else f"{label} of {name}"
        tables.append(table)
    return tables


def separate_labels(folders: Sequence[RunFolder], names: Sequence[str]) -> list[dict[str, str]]:
    """As `pooled_labels`, but trials of different runs are never repeats of one another.

    A label that an earlier run has is followed by the name of the run, and if that is in use too, by its number.
    """
    used = set[str]()
    tables = []
    for number, (folder, name) in enumerate(zip(folders, map(_plain_name, names), strict=True), start=1):
        table = dict[str, str]()
        for label in sorted({score.estimator for score in folder.scores()}):
            named = f"{label} of {name}"
            numbered = f"{named}.{number}"
            table[label] = next(each for each in (label, named, numbered) if each not in used)
        used.update(table.values())
        tables.append(table)
    return tables


def _merge_environments(folders: Sequence[RunFolder], together: RunFolder) -> None:
    """Write the environment of a merged run."""
    environments = [environment for folder in folders if (environment := read_environment(folder))]
    write_json(together.path / ENVIRONMENT, merged_environment(environments))


def _copy_first_decision(folders: Sequence[RunFolder], together: RunFolder) -> None:
    """Copy the first file which states that the units of a run depend on what they showed.

    The units of the merged run then do so, too.
    """
    for folder in folders:
        decision = folder.path / UNTIL
        if decision.is_file():
            copyfile(decision, together.path / UNTIL)
            return


def _link_trial(folder: RunFolder, together: RunFolder, score: TrialScore, label: str) -> None:
    """Add a trial of a run to a merged run, as the next repeat of the estimator with this label."""
    repeats = together.case(score.case) / ESTIMATES / label
    repeat = len(list(repeats.glob("*"))) if repeats.is_dir() else 0
    place = together.estimate(score.case, label, repeat)
    place.mkdir(parents=True)
    source = folder.estimate(score.case, score.estimator, score.repeat)
    for path in source.iterdir():
        if path.name != SCORE:
            (place / path.name).symlink_to(path.resolve())
    merged_score = score.model_copy(update={"estimator": label, "repeat": repeat})
    write_json(place / SCORE, merged_score.model_dump(mode="json"))


def _stated(folder: RunFolder) -> list[dict[str, Any]]:
    try:
        entries = json.loads((folder.path / ESTIMATORS).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return []
    if not isinstance(entries, list):
        return []
    return [entry for entry in entries if isinstance(entry, dict) and "label" in entry]


def is_same_path(one: Path, other: Path) -> bool:
    """Whether two files contain the same true path, except for rounding, which depends on the processor."""
    if one.read_bytes() == other.read_bytes():
        return True
    first = read_tum(one)
    second = read_tum(other)
    if not np.array_equal(first.t_ns, second.t_ns):
        return False
    return bool(np.allclose(first.T_world_frame, second.T_world_frame, rtol=0, atol=SAME_POSE))


def require_same_cases(old: RunFolder, new: RunFolder) -> None:
    """Raise InputError if two runs have different cases with the same name."""
    for case in sorted({score.case for score in new.scores()}):
        _require_same_case(case, old.case(case), new.case(case), "the new run")


def _require_same_case(case: str, one: Path, other: Path, name: str) -> None:
    """Raise InputError if the folders of a case contain different true paths. `name` is the run of the other folder."""
    one_truth = one / GROUND_TRUTH
    other_truth = other / GROUND_TRUTH
    has_both = one_truth.is_file() and other_truth.is_file()
    if has_both and not is_same_path(one_truth, other_truth):
        raise InputError(f"case {case!r} is another one in {name}: its true path differs, so runs cannot be compared")


def _link_case(folder: RunFolder, made: RunFolder, case: str, name: str) -> None:
    source = folder.case(case)
    target = made.case(case)
    _require_same_case(case, target, source, name)
    target.mkdir(parents=True, exist_ok=True)
    # A run that could not create the case has no true path of it. The path of another run is linked then.
    for path in (source / each for each in (*OF_CASE, SEQUENCE)):
        if path.exists() and not (target / path.name).exists():
            (target / path.name).symlink_to(path.resolve())
