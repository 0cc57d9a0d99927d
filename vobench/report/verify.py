"""Whether a run is still what it says: files against their hashes, scores against estimates and truth."""

import json
from collections.abc import Iterator
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
from vobench.runner.score import score_estimate
from vobench.suite.suite import TruthNoise
from vobench.trajectory.formats import format_tum


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was looked at: `wrong` says what is the matter with it, empty where nothing is."""

    kind: str
    what: str
    wrong: str = ""


def verify_run(folder: RunFolder) -> Iterator[Finding]:
    """Recompute all hashes and scores of a run, and compare its sequences with the cache's manifests.

    Raises InputError where the folder is no run.
    """
    files = folder.score_files()
    hashes = read_hashes(folder)
    for name, held in hashes.items():
        stop.check()
        yield Finding("hash", name, _changed(folder.path / name, held))
    for case in sorted({file.parents[3].name for file in files}):
        yield Finding("ground truth", case, _truth_differs(folder.case(case)))
        if (link := folder.case(case) / SEQUENCE).exists():
            yield Finding("cache", case, fault(link.resolve()))
    for file in files:
        stop.check()
        place = file.relative_to(folder.path)
        _, case, _, estimator, repeat, _ = place.parts
        wrong = _rescored(file) if str(place) in hashes else "not of this run, whose hashes do not name it"
        yield Finding("score", f"{estimator} on {case}, {repeat}", wrong)


def _changed(path: Path, held: str) -> str:
    if not path.is_file():
        gone = "gone from the cache; run the suite again to make it anew" if SEQUENCE in path.parts else "missing"
        return f"the file is {gone}"
    return "" if file_hash(path) == held else "not the bytes that the run wrote"


def _truth_differs(case: Path) -> str:
    """The path that was scored against, compared with that in the recording."""
    link = case / SEQUENCE
    if not link.is_symlink() and not (case / GROUND_TRUTH).is_file():
        return ""  # there never was one
    if not link.exists():
        return "its sequence is gone from the cache; run the suite again to make it anew"
    try:
        stated = json.loads((case / CASE).read_bytes())
        truth = format_tum(left_truth(link))
        if noise := stated.get("truth_noise"):
            truth = noisy(truth, TruthNoise(**noise), seed=stated["seed"], frames=stated["frames"])
        same = truth.encode() == (case / GROUND_TRUTH).read_bytes()
    except (VobenchError, OSError, ValueError, LookupError) as error:
        return str(error)
    return "" if same else f"{GROUND_TRUTH} is not the path in its sequence"


def _rescored(file: Path) -> str:
    """A trial's score, computed anew and compared digit by digit."""
    try:
        held = read_score(file)
        if held.score is None and not held.frames:
            return ""  # it came to nothing that could be scored
        gt = read_tum(file.parents[3] / GROUND_TRUTH)
        tracks = {name: file.parent / name for name in (ESTIMATE, REVISED) if (file.parent / name).is_file()}
        scored = {name: score_estimate(read_tum(path), gt, held.claims) for name, path in tracks.items()}
    except (VobenchError, OSError) as error:
        return str(error)
    anew = {name: json.loads(json.dumps(each.as_dict())) for name, each in scored.items() if each}
    for name, before in ((ESTIMATE, held.score), (REVISED, held.revised)):
        if anew.get(name) != before:
            return f"the score differs: {_difference(before, anew.get(name))}"
    return ""


def _difference(held: Any, anew: Any, place: str = "") -> str:
    """Where two JSON values differ first, and how; empty where they don't."""
    if isinstance(held, list) and isinstance(anew, list) and len(held) == len(anew):
        named = ((str(row.get("name", at)) if isinstance(row, dict) else str(at)) for at, row in enumerate(held))
        pairs = list(zip(named, held, anew, strict=True))
    elif isinstance(held, dict) and isinstance(anew, dict) and held.keys() == anew.keys():
        pairs = [(name, value, anew[name]) for name, value in held.items()]
    else:
        return "" if held == anew else f"{place or 'all of it'}: {_brief(held)} is {_brief(anew)} now"
    found = (_difference(before, now, f"{place} {name}".strip()) for name, before, now in pairs)
    return next(filter(None, found), "")


def _brief(value: Any) -> str:
    if isinstance(value, dict | list):
        return f"{len(value)} entries"
    if isinstance(value, float):
        return f"{value:.9g}"
    return "none" if value is None else str(value)
