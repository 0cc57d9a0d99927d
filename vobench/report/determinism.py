"""Whether estimators that state that they are deterministic gave the same answer to the same sequence."""

from collections import Counter
from collections.abc import Sequence

from vobench.errors import counted
from vobench.report.compare import NOT_DETERMINISTIC
from vobench.runner.estimate import ESTIMATE
from vobench.runner.folder import FINISHED_TRIAL, RunFolder, TrialScore


def determinism_remarks(folder: RunFolder, scores: Sequence[TrialScore]) -> list[str]:
    """Sentences on the repeats of deterministic estimators; nothing for a run without repeats.

    A statement of determinism is believed once two answers to one sequence were equal in every byte. Such repeats say
    nothing more than one trial does.
    """
    compared = Counter[str]()  # the number of cases with repeats, by estimator
    differing = Counter[str]()
    for trials in _repeats(scores):
        estimator = trials[0].estimator
        answers = {_answer(folder, trial) for trial in trials}
        compared[estimator] += 1
        differing[estimator] += len(answers) > 1

    sentences = []
    equal = [estimator for estimator in sorted(compared) if not differing[estimator]]
    if equal:
        names = ", ".join(equal)
        sentences.append(
            f"Repeats of {names} are equal in every byte and count once; noise_seeds draws new noise instead"
        )
    for estimator in sorted(compared):
        if differing[estimator]:
            cases = f"{differing[estimator]} of {counted(compared[estimator], 'case')}"
            sentences.append(f"{estimator} states that it is deterministic, but its repeats differ in {cases}")
    return sentences


def _repeats(scores: Sequence[TrialScore]) -> list[list[TrialScore]]:
    """The finished trials of each deterministic estimator on each case that it has answered more than once."""
    by_cell = dict[tuple[str, str], list[TrialScore]]()
    for score in scores:
        if NOT_DETERMINISTIC not in score.claims and score.status in FINISHED_TRIAL:
            by_cell.setdefault((score.estimator, score.case), []).append(score)
    return [trials for trials in by_cell.values() if len(trials) > 1]


def _answer(folder: RunFolder, trial: TrialScore) -> bytes:
    """The estimate of a trial; empty if the file is missing."""
    path = folder.estimate(trial.case, trial.estimator, trial.repeat) / ESTIMATE
    return path.read_bytes() if path.is_file() else b""
