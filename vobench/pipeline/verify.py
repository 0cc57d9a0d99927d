"""Whether a run is still what it says: files against their hashes, scores against estimates and truth."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from vobench.errors import VobenchError
from vobench.pipeline.score import score_estimate
from vobench.pipeline.truth_path import left_truth
from vobench.results import estimate_file
from vobench.results.hashes import file_hash, read_hashes
from vobench.results.run_folder import GROUND_TRUTH, SEQUENCE, RunFolder, RunScore
from vobench.trajectory.text import format_tum


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was looked at: `wrong` says what is the matter with it, empty where nothing is."""

    kind: str
    what: str
    wrong: str = ""


def verify_run(folder: RunFolder) -> Iterator[Finding]:
    """Recompute all hashes and scores of a run from its files. Raises InputError where the folder is no run."""
    scores = folder.scores()
    for name, held in read_hashes(folder).items():
        yield Finding("hash", name, _changed(folder.path / name, held))
    for case in sorted({score.case for score in scores}):
        yield Finding("ground truth", case, _truth_differs(folder.case(case)))
    for score in scores:
        yield Finding("score", f"{score.estimator} on {score.case}, {score.repeat}", _rescored(folder, score))


def _changed(path: Path, held: str) -> str:
    if not path.is_file():
        gone = "gone from the cache; run the suite again to make it anew" if SEQUENCE in path.parts else "missing"
        return f"the file is {gone}"
    return "" if file_hash(path) == held else "not the bytes that the run wrote"


def _truth_differs(case: Path) -> str:
    """The path that was scored against, compared with that in the recording."""
    link = case / SEQUENCE
    if not link.exists():
        return "its sequence is gone from the cache; run the suite again to make it anew"
    try:
        same = format_tum(left_truth(link)) == (case / GROUND_TRUTH).read_text(encoding="utf-8")
    except (VobenchError, OSError) as error:
        return str(error)
    return "" if same else f"{GROUND_TRUTH} is not the path in its sequence"


def _rescored(folder: RunFolder, held: RunScore) -> str:
    """A run's score, computed anew and compared digit by digit."""
    try:
        gt = estimate_file.read_tum(folder.case(held.case) / GROUND_TRUTH)
        scored = score_estimate(folder.estimate(held.case, held.estimator, held.repeat), gt)
    except (VobenchError, OSError) as error:
        return str(error)
    anew = json.loads(json.dumps(scored.as_dict())) if scored else None
    if anew == held.score:
        return ""
    before, now = held.value("ate_trans", "rmse"), held.model_copy(update={"score": anew}).value("ate_trans", "rmse")
    return f"the score differs: ATE {_number(before)} is {_number(now)} now"


def _number(value: float | None) -> str:
    return "none" if value is None else f"{value:.9g} m"
