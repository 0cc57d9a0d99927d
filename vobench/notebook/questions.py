"""Questions from Python: why an estimator fails, how real pictures are, what a recording's twin is worth."""

from collections.abc import Iterable
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
    """Run a trial again without each thing that makes its case hard, and say which removal mends the estimator.

    `run`, `case` and `estimator` name the trial; a path RUN/CASE/ESTIMATOR names all three. `repeats` is the number of
    seeds of each variant, `out` where the folders of runs go. The result has `named`, `rows()` and `to_frame()`.
    Raises InputError where the case is a recording or has nothing that can be removed, and UnknownNameError.
    """
    from vobench.analysis.explain_trial import explain_trial

    perform = _plan_runner(Path(out), jobs, is_quiet=quiet)
    return explain_trial(_trial_path(run, case, estimator, repeat), run_plan=perform, repeats=repeats)


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

    The trial is named as in `explain`; at most `trials` candidates are run. Raises InputError where nothing fails.
    """
    from vobench.analysis.shrink_trial import shrink_trial

    return shrink_trial(
        _trial_path(run, case, estimator, repeat),
        run_plan=_plan_runner(Path(out), jobs, is_quiet=quiet),
        trials=trials,
        folder=None if folder is None else Path(folder),
    )


def causes(run: Run | Path | str, *, estimator: str | None = None) -> "RunCauses":
    """What the errors of each estimator of a run, or of one of them, depend on; `to_frame()` is a table.

    Raises InputError where the sequences of the run are no longer in the cache.
    """
    from vobench.analysis.run_causes import find_causes

    return find_causes(run_path(run), estimator=estimator)


def realism(recording: Path | str, *, against: Path | str | None = None, form: str | None = None) -> "RealismReport":
    """How real the pictures of a recording are: nine statistics beside those of real ones, or of `against`.

    `recording` is a sequence, a run's case, a dataset's folder or a bag. Raises InputError where it cannot be read.
    """
    from vobench.analysis.realism_report import measure_realism

    other = None if against is None else Path(against)
    return measure_realism(Path(recording), against=other, form=form)


def twin(
    recording: Path | str,
    *,
    place: str = "office",
    estimators: Names | None = None,
    form: str | None = None,
    out: Path | str = Path("twin"),
    jobs: int | None = None,
    quiet: bool = False,
) -> "TwinReport":
    """Repeat a recording in simulation, run the same estimators on both, and say how far they agree.

    `out` is a new folder for the suite and its runs. Raises InputError where the recording lacks a stereo pair, a
    ground truth or motion, and UnknownNameError for the place.
    """
    from vobench.analysis.recording_twin import make_twin

    folder = Path(out)
    return make_twin(
        Path(recording),
        run_plan=_plan_runner(folder / "runs", jobs, is_quiet=quiet, with_reports=True),
        out=folder,
        place=place,
        estimators=listed(estimators),
        form=form,
    )


def drive(suite: str | Path, *, trajectory: str | None = None, changes: dict[str, Any] | None = None) -> "SuiteDrive":
    """Drive the trajectories of a suite, or one of them, without rendering.

    Raises SuiteError where a body cannot follow its trajectory, and UnknownNameError.
    """
    from vobench.runner.drive import drive_plan

    return drive_plan(plan(suite, changes=changes), trajectory=trajectory)


def _plan_runner(out: Path, jobs: int | None, *, is_quiet: bool, with_reports: bool = False) -> PlanRunner:
    finish = None
    if with_reports:
        from vobench.report.page import write_reports

        finish = write_reports
    return plan_runner(out=out, jobs=jobs, make_display=partial(choose_display, is_quiet=is_quiet), finish=finish)


def _trial_path(run: Run | Path | str, case: str | None, estimator: str | None, repeat: int) -> Path:
    """RUN/CASE/ESTIMATOR/REPEAT. Raises InputError where only one of case and estimator is given."""
    path = run_path(run)
    if case is None and estimator is None:
        if isinstance(run, Run):
            raise InputError("a trial is named by its case and estimator, as in explain(run, case, estimator)")
        return path
    if case is None or estimator is None:
        raise InputError("a trial is named by both its case and its estimator")
    parts: Iterable[str] = (case, estimator, str(repeat))
    return path.joinpath(*parts)
