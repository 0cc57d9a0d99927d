"""Whether the files of a run are unchanged: hashes are compared, and scores recomputed from estimates and truth."""

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vobench import stop
from vobench.errors import VobenchError
from vobench.runner.entry import fault, file_hash
from vobench.runner.estimate import ESTIMATE, REVISED
from vobench.runner.folder import CASE, SEQUENCE, RunFolder, read_hashes, read_score, read_tum
from vobench.runner.frames import GROUND_TRUTH
from vobench.runner.ground_truth import left_truth, noisy
from vobench.runner.rescore import brief_value
from vobench.runner.score import score_estimate
from vobench.suite.suite_spec import TruthNoise
from vobench.trajectory.tum import format_tum

NOT_IN_CACHE = "no longer in the cache; run the suite again to recreate it"


@dataclass(frozen=True, slots=True)
class VerifiedItem:
    """An item of a run that was verified; `wrong` states what is wrong with it, empty if nothing is."""

    kind: str
    what: str
    wrong: str = ""


def verify_run(folder: RunFolder) -> Iterator[VerifiedItem]:
    """Recompute all hashes and scores of a run, and compare its sequences with the manifests of the cache.

    Raises InputError if the folder is not a run.
    """
    scores = folder.score_files()
    hashes = read_hashes(folder)
    yield from _verify_hashes(folder, hashes)
    yield from _verify_cases(folder, scores)
    yield from _verify_scores(folder, scores, hashes)


def _verify_hashes(folder: RunFolder, hashes: dict[str, str]) -> Iterator[VerifiedItem]:
    for name, expected in hashes.items():
        stop.check()
        yield VerifiedItem("hash", name, _hash_fault(folder.path / name, expected))


def _verify_cases(folder: RunFolder, scores: Iterable[Path]) -> Iterator[VerifiedItem]:
    """The ground truth of each case, and its sequence if it is in the cache."""
    cases = {score.parents[3].name for score in scores}
    for case in sorted(cases):
        yield VerifiedItem("ground truth", case, _truth_fault(folder.case(case)))
        sequence = folder.case(case) / SEQUENCE
        if sequence.exists():
            yield VerifiedItem("cache", case, fault(sequence.resolve()))


def _verify_scores(folder: RunFolder, scores: Iterable[Path], hashes: dict[str, str]) -> Iterator[VerifiedItem]:
    for score in scores:
        stop.check()
        path = score.relative_to(folder.path)
        _, case, _, estimator, repeat, _ = path.parts
        is_of_run = str(path) in hashes
        wrong = _score_fault(score) if is_of_run else "not part of the run: its hashes do not list this file"
        yield VerifiedItem("score", f"{estimator} on {case}, {repeat}", wrong)


def _hash_fault(path: Path, expected: str) -> str:
    if not path.is_file():
        return f"the file is {NOT_IN_CACHE}" if SEQUENCE in path.parts else "the file is missing"
    return "" if file_hash(path) == expected else "the file has changed since the run wrote it"


def _truth_fault(case: Path) -> str:
    """The difference between the ground truth that was scored against and the one in the recording."""
    link = case / SEQUENCE
    truth = case / GROUND_TRUTH
    was_never_made = not link.is_symlink() and not truth.is_file()
    if was_never_made:
        return ""
    if not link.exists():
        return f"its sequence is {NOT_IN_CACHE}"
    try:
        is_same = _recorded_truth(case).encode() == truth.read_bytes()
    except (VobenchError, OSError, ValueError, LookupError) as error:
        return str(error)
    return "" if is_same else f"{GROUND_TRUTH} differs from the path in the sequence"


def _recorded_truth(case: Path) -> str:
    """The path in a case's recording as text, with the noise that its scores are computed with."""
    settings = json.loads((case / CASE).read_bytes())
    truth = format_tum(left_truth(case / SEQUENCE))
    noise = settings.get("truth_noise")
    if not noise:
        return truth
    return noisy(truth, TruthNoise(**noise), seed=settings["seed"], frames=settings["frames"])


def _score_fault(file: Path) -> str:
    """The first difference between a trial's score and the one recomputed from its estimate, digit by digit."""
    try:
        score = read_score(file)
        has_no_estimate = score.score is None and not score.frames
        if has_no_estimate:
            return ""
        truth = read_tum(file.parents[3] / GROUND_TRUTH)
        recomputed = {}
        for name in (ESTIMATE, REVISED):
            path = file.parent / name
            if path.is_file():
                rescored = score_estimate(read_tum(path), truth, score.claims)
                recomputed[name] = json.loads(json.dumps(rescored.as_dict())) if rescored else None
    except (VobenchError, OSError) as error:
        return str(error)

    for name, stated in ((ESTIMATE, score.score), (REVISED, score.revised)):
        computed = recomputed.get(name)
        if computed != stated:
            return f"the score differs: {first_difference(stated, computed)}"
    return ""


def first_difference(stated: Any, computed: Any, path: str = "") -> str:
    """The first difference between two JSON values, with its path; empty if they are equal."""
    members = _common_members(stated, computed)
    if members is None:
        if stated == computed:
            return ""
        return f"{path or 'all of it'}: {brief_value(stated)} is stated, {brief_value(computed)} is computed"
    for name, stated_member, computed_member in members:
        difference = first_difference(stated_member, computed_member, f"{path} {name}".strip())
        if difference:
            return difference
    return ""


def _common_members(stated: Any, computed: Any) -> list[tuple[str, Any, Any]] | None:
    """The members of two JSON objects or arrays with their names, None if these are not of the same form."""
    if isinstance(stated, dict) and isinstance(computed, dict) and stated.keys() == computed.keys():
        return [(name, value, computed[name]) for name, value in stated.items()]
    if isinstance(stated, list) and isinstance(computed, list) and len(stated) == len(computed):
        names = [_member_name(index, value) for index, value in enumerate(stated)]
        return list(zip(names, stated, computed, strict=True))
    return None


def _member_name(index: int, value: Any) -> str:
    """The name of an array's member: its key `name` if it has one, or else its index."""
    return str(value.get("name", index)) if isinstance(value, dict) else str(index)
