"""A run as one zip file that others can score again, and several runs as one."""

import json
import stat
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any
from zipfile import ZIP_DEFLATED, BadZipFile, ZipFile, ZipInfo

import numpy as np

from vobench.errors import InputError
from vobench.runner.consistency import COVARIANCE
from vobench.runner.entry import file_hash
from vobench.runner.environment import merged_environment, read_environment
from vobench.runner.estimate import ESTIMATE, FINISHED, LOG, REVISED, Outcome
from vobench.runner.folder import (
    CASE,
    ENVIRONMENT,
    ESTIMATES,
    ESTIMATORS,
    HASHES,
    SCORE,
    SEQUENCE,
    SUITE,
    SURVIVED,
    TIMES_HASHES,
    RunFolder,
    TrialScore,
    open_run,
    read_hashes,
    read_tum,
)
from vobench.runner.frames import FRAMES, GROUND_TRUTH, TIMES
from vobench.runner.score import score_estimate, status_of
from vobench.runner.store import write_json

OF_RUN, OF_CASE = (SUITE, ENVIRONMENT, ESTIMATORS), (CASE, GROUND_TRUTH)
OF_TRIAL = (SCORE, ESTIMATE, REVISED, COVARIANCE, FRAMES, TIMES, LOG)
SEQUENCES = "sequence_hashes.json"  # of the recordings, which are too large for a bundle
MOST_BYTES = 8 << 30  # unpacked
SAME_POSE = 1e-9  # metres, and elements of a rotation: below it two poses are one
EPOCH = (1980, 1, 1, 0, 0, 0)  # no date, so that equal runs make equal bundles


def bundle(folder: RunFolder, out: Path) -> int:
    """Write suite, versions, truth, estimates, scores and the hashes of all into a zip file; how many files.

    Raises InputError where the folder is none of a run.
    """
    places = [folder.path, *(file.parent for file in folder.score_files())]
    places[1:1] = sorted({place.parents[2] for place in places[1:]})
    names = [*(folder.path / name for name in OF_RUN)]
    names += [place / name for place in places[1:] for name in (*OF_CASE, *OF_TRIAL)]
    files = {str(path.relative_to(folder.path)): path for path in names if path.is_file()}
    recorded = {name: held for name, held in read_hashes(folder).items() if SEQUENCE in PurePosixPath(name).parts}
    hashes = {name: file_hash(path) for name, path in files.items()}
    with ZipFile(out, "w", ZIP_DEFLATED) as file:
        for name, stated in ((HASHES, hashes), (TIMES_HASHES, {}), (SEQUENCES, recorded)):
            file.writestr(ZipInfo(name, EPOCH), json.dumps(stated, indent=1), ZIP_DEFLATED)
        for name, path in files.items():
            file.writestr(ZipInfo(name, EPOCH), path.read_bytes(), ZIP_DEFLATED)
    return len(files)


@contextmanager
def opened(path: Path) -> Iterator[RunFolder]:
    """The run of a folder or a bundle, which is unpacked for so long. Raises InputError where it is neither."""
    if not path.is_file():
        yield open_run(path)
        return
    with TemporaryDirectory(prefix="vobench-bundle-") as temporary:
        try:
            with ZipFile(path) as file:
                folder = RunFolder(Path(temporary) / _suite(file) / path.stem)
                _unpack(file, folder.path, path)
        except (BadZipFile, NotImplementedError, RuntimeError, EOFError) as error:
            raise InputError(f"neither a run's folder nor a bundle of one ({error}): {path}") from None
        for name, held in read_hashes(folder).items():
            there = folder.path / name
            if not there.is_file() or file_hash(there) != held:
                raise InputError(f"{name} is not the file that was bundled: {path}")
        yield folder


def _suite(file: ZipFile) -> str:
    """The suite's name, as a folder may have it."""
    try:
        name = str(json.loads(file.read(SUITE))["name"])
    except (KeyError, ValueError, TypeError):
        return "bundle"
    return name if name not in ("", ".", "..") and not set(name) & set("/\\\0") else "bundle"


def _unpack(file: ZipFile, to: Path, path: Path) -> None:
    entries = file.infolist()
    if (total := sum(entry.file_size for entry in entries)) > MOST_BYTES:
        raise InputError(f"unpacks to {total / 1e9:.3g} GB, more than {MOST_BYTES / 1e9:.3g}: {path}")
    for entry in entries:
        parts = PurePosixPath(entry.filename).parts
        if entry.filename.startswith("/") or ".." in parts or stat.S_ISLNK(entry.external_attr >> 16):
            raise InputError(f"holds a file that would lie outside of it ({entry.filename!r}): {path}")
    to.mkdir(parents=True)
    file.extractall(to)


def scored_again(folder: RunFolder) -> Iterator[tuple[TrialScore, bool]]:
    """Each trial with its score computed anew from estimate and truth, and whether that is what it was.

    A failure stays one, for why an estimator died is in no trajectory.
    """
    for held in folder.scores():
        place, truth = folder.estimate(held.case, held.estimator, held.repeat), folder.case(held.case) / GROUND_TRUTH
        if not held.frames or not truth.is_file():
            yield held, held.score is None
            continue
        gt, revised = read_tum(truth), place / REVISED
        scored = score_estimate(read_tum(place / ESTIMATE), gt, held.claims)
        later = score_estimate(read_tum(revised), gt, held.claims) if revised.is_file() else None
        stated = {name: _plain(each) for name, each in (("score", scored), ("revised", later))}
        anew: dict[str, Any] = {**stated, "coverage": scored.coverage.ratio if scored else 0.0}
        if held.status in SURVIVED:
            status, reason = status_of(Outcome(kind=FINISHED, reason=""), scored, gt)
            if status not in SURVIVED and "too late" not in held.reason:
                anew |= {"status": status, "reason": reason}
        again = held.model_copy(update=anew)
        yield again, again == held


def _plain(scored: Any) -> dict[str, Any] | None:
    found: dict[str, Any] | None = json.loads(json.dumps(scored.as_dict())) if scored else None
    return found


@contextmanager
def merged(folders: Sequence[RunFolder], names: Sequence[str]) -> Iterator[RunFolder]:
    """Several runs as one, for so long.

    The same estimator's trials are repeats of one another; another one of the same label gets its run's name behind it.
    Raises InputError where two runs have another case of the same name.
    """
    if len(folders) == 1:
        yield folders[0]
        return
    with TemporaryDirectory(prefix="vobench-merged-") as temporary:
        made = RunFolder(Path(temporary) / "merged" / "runs")
        made.path.mkdir(parents=True)
        environments = [stated for folder in folders if (stated := read_environment(folder))]
        write_json(made.path / ENVIRONMENT, merged_environment(environments))
        known = dict[str, Any]()
        for folder, name in zip(folders, names, strict=True):
            facts = {each["label"]: each for each in _stated(folder)}
            for score in folder.scores():
                _link_case(folder, made, score.case, name)
                label = score.estimator
                if known.setdefault(label, facts.get(label)) != facts.get(label):
                    label = f"{label} of {name}"
                others = made.case(score.case) / ESTIMATES / label
                repeat = len(list(others.glob("*"))) if others.is_dir() else 0
                place = made.estimate(score.case, label, repeat)
                place.mkdir(parents=True)
                for path in folder.estimate(score.case, score.estimator, score.repeat).iterdir():
                    if path.name != SCORE:
                        (place / path.name).symlink_to(path.resolve())
                again = score.model_copy(update={"estimator": label, "repeat": repeat})
                write_json(place / SCORE, again.model_dump(mode="json"))
        yield made


def _stated(folder: RunFolder) -> list[dict[str, Any]]:
    try:
        found = json.loads((folder.path / ESTIMATORS).read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return []
    return [each for each in found if isinstance(each, dict) and "label" in each]


def _is_same_path(one: Path, other: Path) -> bool:
    """Whether two files hold one true path; processors of other makes round its last digits differently."""
    if one.read_bytes() == other.read_bytes():
        return True
    first = read_tum(one)
    second = read_tum(other)
    if not np.array_equal(first.t_ns, second.t_ns):
        return False
    return bool(np.allclose(first.T_world_frame, second.T_world_frame, rtol=0, atol=SAME_POSE))


def _link_case(folder: RunFolder, made: RunFolder, case: str, name: str) -> None:
    source, target = folder.case(case), made.case(case)
    truths = [place / GROUND_TRUTH for place in (source, target)]
    if all(truth.is_file() for truth in truths) and not _is_same_path(*truths):
        raise InputError(f"case {case!r} is another one in {name}: its true path differs, so nothing compares")
    target.mkdir(parents=True, exist_ok=True)
    # A run that could not make the case has no true path of it; then another run's is linked.
    for path in (source / each for each in (*OF_CASE, SEQUENCE)):
        if path.exists() and not (target / path.name).exists():
            (target / path.name).symlink_to(path.resolve())
