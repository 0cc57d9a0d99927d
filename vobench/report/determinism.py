"""Whether estimators that state that they are deterministic gave the same answer to the same sequence."""

from collections.abc import Sequence
from dataclasses import dataclass

from vobench.runner.estimate import ESTIMATE
from vobench.runner.folder import FINISHED_TRIAL, NOT_DETERMINISTIC, RunFolder, TrialScore


@dataclass(frozen=True, slots=True)
class RepeatedAnswers:
    """The answers of an estimator that states that it is deterministic to sequences that it was given repeatedly.

    `differing` are the cases of `cases` on which not all answers are equal in every byte.
    """

    estimator: str
    cases: tuple[str, ...]
    differing: tuple[str, ...]

    @property
    def are_equal(self) -> bool:
        """Whether the statement is believed."""
        return not self.differing


def repeated_answers(folder: RunFolder, scores: Sequence[TrialScore]) -> list[RepeatedAnswers]:
    """The repeated answers of each deterministic estimator in a run, by name; none in a run without repeats."""
    cases_of: dict[str, list[str]] = {}
    differing_of: dict[str, list[str]] = {}
    for trials in _repeats(scores):
        estimator = trials[0].estimator
        case = trials[0].case
        answers = {_answer(folder, trial) for trial in trials}
        cases_of.setdefault(estimator, []).append(case)
        if len(answers) > 1:
            differing_of.setdefault(estimator, []).append(case)
    found = []
    for estimator, cases in sorted(cases_of.items()):
        found.append(RepeatedAnswers(estimator, tuple(cases), tuple(differing_of.get(estimator, ()))))
    return found


def determinism_remarks(repeated: Sequence[RepeatedAnswers]) -> list[str]:
    """One sentence for each estimator that is not believed to be deterministic, and one for all that are."""
    sentences = []
    equal = [answers.estimator for answers in repeated if answers.are_equal]
    if equal:
        verb = "is" if len(equal) == 1 else "are"
        sentences.append(f"Deterministic by two answers that are equal in every byte {verb} {', '.join(equal)}")
    for answers in repeated:
        if not answers.are_equal:
            cases = ", ".join(answers.differing)
            sentences.append(
                f"{answers.estimator} states that it is deterministic, but gave different answers to {cases}; "
                "it counts as not deterministic"
            )
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
