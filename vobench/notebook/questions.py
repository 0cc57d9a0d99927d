"""Questions from Python: why an estimator fails, how realistic pictures are, how well a simulated twin agrees."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vobench.errors import InputError
from vobench.notebook.display import choose_display
from vobench.notebook.runs import RUNS, Names, Run, listed, plan, run_path
from vobench.runner.launch import plan_runner
from vobench.runner.plan_runner import PlanRunner

if TYPE_CHECKING:
    from vobench.analysis.explain_trial import TrialExplanation
    from vobench.analysis.realism_report import RealismReport
    from vobench.analysis.recording_explanation import RecordingExplanation
    from vobench.analysis.recording_twin import TwinReport
    from vobench.analysis.run_causes import RunCauses
    from vobench.analysis.shrink_trial import ShrunkTrial
    from vobench.runner.drive import SuiteDrive


def explain(
    run: Run | Path | str,
    case: str | None = None,
    estimator: str | None = None,
    *,
    repeat: int = 0,
    repeats: int = 3,
    jobs: int | None = None,
    out: Path | str = RUNS,
    quiet: bool = False,
) -> "TrialExplanation":
    """Run a trial again without each difficulty of its case, and report whose removal fixes the estimator.

    `run`, `case` and `estimator` name the trial; a path RUN/CASE/ESTIMATOR names all three. `repeats` is the number of
    seeds of each variant, and `out` the parent folder of the runs. The result has `named`, `rows()` and `to_frame()`.
    Raises InputError if the case is a recording or has no difficulty that can be removed, and UnknownNameError.
    """
    from vobench.analysis.explain_trial import explain_trial

    perform = _plan_runner(Path(out), jobs, is_quiet=quiet)
    return explain_trial(_trial_path(run, case, estimator, repeat), run_plan=perform, repeats=repeats)


def explain_recording(
    recording: Path | str,
    *,
    estimate: Path | str | None = None,
    estimator: str | None = None,
    place: str = "office",
    form: str | None = None,
    repeats: int = 3,
    out: Path | str = Path("explained"),
    jobs: int | None = None,
    quiet: bool = False,
) -> "RecordingExplanation":
    """Explain why an estimator fails in the worst five seconds of a recording, by a simulated twin of them.

    `estimate` is the file of an estimate; without one, `estimator` (lk_epipolar by default) is run on the recording.
    `out` is a new folder for the twin. The result has `named`, `sentences` and `rows()`. Raises InputError if the
    recording has no stereo pair, no ground truth or no failing frames, and UnknownNameError.
    """
    from vobench.analysis import explain_recording as analysis

    folder = Path(out)
    return analysis.explain_recording(
        Path(recording),
        run_plan=_plan_runner(folder / "runs", jobs, is_quiet=quiet),
        estimate=None if estimate is None else Path(estimate),
        estimator=estimator,
        place=place,
        out=folder,
        repeats=repeats,
        form=form,
    )


def shrink(
    run: Run | Path | str,
    case: str | None = None,
    estimator: str | None = None,
    *,
    repeat: int = 0,
    trials: int = 12,
    folder: Path | str | None = None,
    jobs: int | None = None,
    out: Path | str = RUNS,
    quiet: bool = False,
) -> "ShrunkTrial":
    """Find the shortest part of a failed trial that fails in the same way, and save it as a suite in `folder`.

    The trial is named as in `explain`; at most `trials` candidates are run. Raises InputError if it did not fail.
    """
    from vobench.analysis.shrink_trial import shrink_trial

    return shrink_trial(
        _trial_path(run, case, estimator, repeat),
        run_plan=_plan_runner(Path(out), jobs, is_quiet=quiet),
        trials=trials,
        folder=None if folder is None else Path(folder),
    )


def causes(run: Run | Path | str, *, estimator: str | None = None) -> "RunCauses":
    """The conditions that the errors of the estimators of a run depend on; `to_frame()` is a table.

    With `estimator`, of that one only. Raises InputError if the sequences of the run are no longer in the cache.
    """
    from vobench.analysis.run_causes import find_causes

    return find_causes(run_path(run), estimator=estimator)


def realism(
    recording: Path | str, *, against: Path | str | None = None, domain: str = "car", form: str | None = None
) -> "RealismReport":
    """How realistic the pictures of a recording are: nine statistics, compared with real pictures or with `against`.

    `recording` is a sequence, a case of a run, a folder of a dataset or a bag. `domain` is what carries the camera:
    "car", "drone", "hand" or "robot"; only "car" has bands. Raises InputError if the recording cannot be read.
    """
    from vobench.analysis.realism_report import measure_realism

    other = None if against is None else Path(against)
    return measure_realism(Path(recording), against=other, domain=domain, form=form)


def twin(
    recording: Path | str | None = None,
    *,
    report: Path | str | None = None,
    place: str = "recorded",
    placements: int = 3,
    estimators: Names | None = None,
    form: str | None = None,
    out: Path | str = Path("twin"),
    jobs: int | None = None,
    quiet: bool = False,
) -> "TwinReport":
    """Simulate a twin of a recording, run the same estimators on both, and report how well the results agree.

    `out` is the folder for the suite and its runs, new or of an interrupted call. With `report`, which is such a
    folder, in place of the recording, the suite in it is run and compared as it is. `estimators` are names, labels of
    the usual ones, or entries of a suite in YAML. `place` is the recorded one, rebuilt from the images, or the first
    that is tried. `placements` is the largest number of twins.
    Raises InputError if the recording has no stereo pair, no ground truth or no motion, and UnknownNameError for the
    place.
    """
    from vobench.analysis.recording_twin import compare_twin, make_twin, read_twin_suite

    if (recording is None) == (report is None):
        raise InputError("name either a recording, or the folder of a twin with report=")
    folder = Path(out if report is None else report)
    run_plan = _plan_runner(folder / "runs", jobs, is_quiet=quiet, with_reports=True)
    if recording is None:
        return compare_twin(read_twin_suite(folder), run_plan=run_plan)
    return make_twin(
        Path(recording),
        run_plan=run_plan,
        out=folder,
        place=place,
        placements=placements,
        estimators=listed(estimators),
        form=form,
    )


def drive(suite: str | Path, *, trajectory: str | None = None, changes: dict[str, Any] | None = None) -> "SuiteDrive":
    """Drive the trajectories of a suite, or one of them, without rendering.

    Raises SuiteError if a body cannot follow its trajectory, and UnknownNameError.
    """
    from vobench.runner.drive import drive_plan

    return drive_plan(plan(suite, changes=changes), trajectory=trajectory)


def _plan_runner(out: Path, jobs: int | None, *, is_quiet: bool, with_reports: bool = False) -> PlanRunner:
    finish = None
    if with_reports:
        from vobench.report.page import write_reports

        finish = write_reports
    make_display = partial(choose_display, is_quiet=is_quiet)
    return plan_runner(out=out, jobs=jobs, make_display=make_display, finish=finish)


def _trial_path(run: Run | Path | str, case: str | None, estimator: str | None, repeat: int) -> Path:
    """The path RUN/CASE/ESTIMATOR/REPEAT. Raises InputError if only one of case and estimator is given."""
    path = run_path(run)
    if case is None and estimator is None:
        if isinstance(run, Run):
            raise InputError("name a trial by its case and its estimator, as in explain(run, case, estimator)")
        return path
    if case is None or estimator is None:
        raise InputError("name a trial by both its case and its estimator")
    return path / case / estimator / str(repeat)
