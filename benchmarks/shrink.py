"""Shrinks the worst trials of a run that ended well, and runs each saved suite again in another folder.

    vobench run benchmarks/shrink.yaml && python benchmarks/shrink.py runs/shrink/latest --count 20

For each trial it prints the share of frames that is left, and whether the suite fails in the same way there.
"""

import argparse
import shutil
import tempfile
from pathlib import Path

from vobench.analysis.shrink_trial import AccuracyFailure, TrialFailure, failure_of, shrink_trial
from vobench.cli.plan_runner import plan_runner
from vobench.errors import InputError
from vobench.runner.finished_trial import read_finished_trial
from vobench.runner.folder import RunFolder
from vobench.suite.suite import read_plan

LARGEST_SHARE = 0.25  # of the frames, that a shrunk case should have


def main() -> None:
    """Shrink the trials with the largest errors, and print a line for each of them."""
    parser = argparse.ArgumentParser()
    parser.add_argument("run", type=Path)
    parser.add_argument("--count", type=int, default=10)
    arguments = parser.parse_args()

    worst = _worst_trials(arguments.run)[: arguments.count]
    small = 0
    alike = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run_plan = plan_runner(out=folder / "runs", jobs=1)
        for number, (trial, failure) in enumerate(worst):
            saved = folder / "here" / str(number)
            shrunk = shrink_trial(trial, run_plan=run_plan, folder=saved)
            first, end = shrunk.found.window
            share = (end - first) / shrunk.frame_count

            moved = folder / "elsewhere" / str(number)
            shutil.move(saved, moved)
            again = run_plan(read_plan(str(moved / shrunk.suite.name)))
            (score,) = again.scores()
            fails_alike = failure.is_in(again, score)

            small += share <= LARGEST_SHARE
            alike += fails_alike
            verdict = "fails in the same way" if fails_alike else "DOES NOT FAIL"
            trials = len(shrunk.found.tried)
            result = f"{share:.0%} of the frames in {trials} trials, {verdict}"
            print(f"{failure.summary} ({shrunk.score.case}): {result}", flush=True)
    count = len(worst)
    print(f"{small} of {count} have at most {LARGEST_SHARE:.0%} of the frames; {alike} fail in the same way elsewhere")


def _worst_trials(run: Path) -> list[tuple[Path, TrialFailure]]:
    """The trials that ended well with a large error, the largest first, and how they failed."""
    found = list[tuple[float, Path, TrialFailure]]()
    for score in RunFolder(run).scores():
        trial = run / score.case / score.estimator
        try:
            failure = failure_of(read_finished_trial(trial))
        except InputError:
            continue  # its error is small
        if isinstance(failure, AccuracyFailure):
            found.append((failure.loss, trial, failure))
    found.sort(key=lambda entry: entry[0], reverse=True)
    return [(trial, failure) for _, trial, failure in found]


if __name__ == "__main__":
    main()
