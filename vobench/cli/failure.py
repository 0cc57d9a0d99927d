"""vobench causes, explain and shrink: why an estimator fails."""

import json as json_module
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from pydantic import ValidationError

from vobench.analysis.causes import Attribution, Course, attribute
from vobench.analysis.conditions import CONDITIONS, conditions
from vobench.analysis.explain import Change, Explanation, Outcome, explain, loss_between, mends, segment_loss
from vobench.analysis.nuisance import NUISANCES, nuisances_of
from vobench.analysis.shrink import FEWEST_FRAMES, Failure, Shrunk, shrink
from vobench.cli import terminal
from vobench.cli.run import run_plan
from vobench.errors import InputError, UnknownNameError, unknown
from vobench.runner.estimate import ESTIMATE, FINISHED
from vobench.runner.estimate import Outcome as Ended
from vobench.runner.folder import (
    CASE,
    ESTIMATORS,
    NO_SEQUENCE,
    SCORE,
    SEQUENCE,
    SUITE,
    SURVIVED,
    RunFolder,
    TrialScore,
    open_run,
    read_score,
    read_tum,
    with_sequence,
)
from vobench.runner.frames import GROUND_TRUTH, read_frames
from vobench.runner.key import folder_digest
from vobench.runner.motion import body_motion, body_motions
from vobench.runner.score import score_estimate, status_of
from vobench.suite import catalog
from vobench.suite.case_file import write_case
from vobench.suite.manifest import read_manifest
from vobench.suite.suite import Case, Entrant, Plan, Suite, Window
from vobench.suite.yaml_file import Mistakes, YamlFile, checked

if TYPE_CHECKING:
    from vobench.trajectory.trajectory import Trajectory

TrialPath = Annotated[
    Path, typer.Argument(metavar="RUN/CASE/ESTIMATOR", help="A trial, as runs/quickstart/latest/room-down/lk_epipolar.")
]
Seeds = Annotated[int, typer.Option("--repeats", "-n", min=1, max=20, help="Seeds for each; few frames take more.")]
Out = Annotated[Path, typer.Option(help="Where the folders of runs go.")]
Jobs = Annotated[int, typer.Option("--jobs", "-j", min=1, envvar="VOBENCH_JOBS", help="Tasks at once.")]
EstimatorPath = Annotated[
    Path | None, typer.Option("--estimator", help="The estimator's folder, where it is not found by its name.")
]


@dataclass(frozen=True, slots=True)
class Tried:
    """A trial of a run, and what makes it again: its case, its entrant, and the suite that it was part of."""

    folder: RunFolder
    score: TrialScore
    case: Case
    entrant: Entrant
    suite: Suite

    @property
    def place(self) -> Path:
        """Where its files are."""
        return self.folder.estimate(self.score.case, self.score.estimator, self.score.repeat)


def read_trial(path: Path, *, estimator: Path | None = None) -> Tried:
    """The trial at RUN/CASE/ESTIMATOR, with /REPEAT where it is not the first, or at its own folder.

    Raises InputError and UnknownNameError for what is not there, or was recorded and cannot be made in another way.
    """
    folder, score = _found(path)
    if score.status == NO_SEQUENCE:
        raise InputError(f"'{score.case}' has no sequence, as it could not be made: {score.reason}")
    case = read_simulated(folder, score.case)
    return Tried(folder, score, case, _entrant(folder, score.estimator, estimator), _suite(folder))


def _found(path: Path) -> tuple[RunFolder, TrialScore]:
    if (path / SCORE).is_file() and len(path.parts) > 5:
        return RunFolder(path.parents[4]), read_score(path / SCORE)
    *before, case, name, repeat = ("", "", *path.parts) if path.name.isdigit() else ("", "", *path.parts, "0")
    folder = open_run(Path(*before))
    scores = folder.scores()
    for kind, said, known in (
        ("case", case, {score.case for score in scores}),
        ("estimator", name, {score.estimator for score in scores}),
    ):
        if said not in known:
            raise UnknownNameError(f"{unknown(kind, said, sorted(known))} in the run {folder.path}")
    found = [s for s in scores if (s.case, s.estimator, s.repeat) == (case, name, int(repeat))]
    if not found:
        raise InputError(f"there is no repeat {repeat} of {name} on {case} in the run {folder.path}")
    return folder, found[0]


def read_simulated(folder: RunFolder, case: str) -> Case:
    """A case of a run. Raises InputError where it was recorded elsewhere, or by another vobench."""
    path = folder.case(case) / CASE
    said = json_module.loads(path.read_bytes())
    if "source" in said:
        raise InputError(f"'{case}' is a recording: nothing in it can be changed and made again: {path}")
    try:
        return checked(Case, said)
    except ValidationError as error:
        place = ".".join(map(str, error.errors()[0]["loc"]))
        raise InputError(f"of another vobench, whose cases this one cannot read ({place}): {path}") from None


def _suite(folder: RunFolder) -> Suite:
    try:
        return checked(Suite, json_module.loads((folder.path / SUITE).read_bytes()))
    except ValidationError:
        raise InputError(f"of another vobench, whose suites this one cannot read: {folder.path / SUITE}") from None


def _entrant(folder: RunFolder, label: str, path: Path | None) -> Entrant:
    """The estimator as it took part. Raises UnknownNameError where its folder is not found by its name."""
    listed = json_module.loads((folder.path / ESTIMATORS).read_bytes())
    facts = next(entry for entry in listed if entry["label"] == label)
    place = path or catalog.find("estimator", facts["name"]).path
    manifest = read_manifest(place)
    if folder_digest(place) != facts["code"]:
        terminal.warn(f"{place} has changed since the run, whose {label} this is")
    limits = replace(manifest.limits, **facts["limits"])
    return Entrant(label, place, manifest, facts["params"], limits, facts["mode"])


def run_cases(tried: Tried, cases: Mapping[str, Case], *, name: str, out: Path, jobs: int) -> RunFolder:
    """Run the trial's estimator on these cases, as any suite is run. Raises SuiteError where one cannot be."""
    named = tuple(replace(case, name=key) for key, case in cases.items())
    source = YamlFile(tried.folder.path / SUITE, {})
    suite = replace(tried.suite, name=name, repeats=1)
    plan = Plan(suite, named, (), (tried.entrant,), (), source)
    wrong = Mistakes(source)
    with wrong.at():
        body_motions(plan)
    wrong.require_none()
    return run_plan(plan, {}, out=out, jobs=jobs, finish=lambda *_: None, require_all=True)


def outcome(folder: RunFolder, score: TrialScore) -> Outcome:
    """How a trial of a run ended, and its error in each segment."""
    gt, est, scale = _paths(folder, score)
    return Outcome(score.status, score.status in SURVIVED, segment_loss(gt, est, scale=scale))


def _paths(folder: RunFolder, score: TrialScore) -> "tuple[Trajectory, Trajectory, float]":
    gt = read_tum(folder.case(score.case) / GROUND_TRUTH)
    est = read_tum(folder.estimate(score.case, score.estimator, score.repeat) / ESTIMATE)
    return gt, est, float(score.score["alignment"]["scale"]) if score.score else 1.0


def course(folder: RunFolder, score: TrialScore, of_frames: Mapping[str, Any]) -> Course:
    """A trial frame by frame, with its case's conditions."""
    gt, est, scale = _paths(folder, score)
    import numpy as np

    loss = np.append(0.0, loss_between(gt, est, np.arange(len(gt)), scale=scale))
    return Course(score.case, score.repeat, of_frames, loss)


def conditions_of(folder: RunFolder, case: Case) -> dict[str, Any]:
    """The conditions of a case's frames. Raises InputError where its sequence is no longer in the cache."""
    from vobench.sequence import Sequence as Recorded

    link = folder.case(case.name) / SEQUENCE
    if not link.exists():
        raise InputError(f"the sequence is gone from the cache; run the suite again to make it anew: {link}")
    trial = next(folder.case(case.name).glob("estimates/*/*"))
    exposures = {row.t_ns: (row.exposure_s or 0.0, row.gain_db or 0.0) for row in read_frames(trial)}
    gt = read_tum(folder.case(case.name) / GROUND_TRUTH)
    return conditions(case, gt, Recorded.open(link).frames(), exposures)


def causes_command(
    run: terminal.RunPath,
    *,
    estimator: Annotated[str | None, typer.Option(help="Only this one.")] = None,
    worst: Annotated[int, typer.Option(min=1, help="How many segments to list.")] = 8,
    json: terminal.Json = False,
) -> None:
    """Say what a run's errors hang on, where each trial went wrong first, and its worst segments."""
    folder = open_run(run)
    scores = with_sequence(folder.scores())
    labels = sorted({score.estimator for score in scores})
    chosen = [terminal.known("estimator", estimator, labels)] if estimator else labels
    of_frames = {}
    for name in terminal.Bars().track(cases := sorted({s.case for s in scores}), "look at", total=len(cases)):
        of_frames[name] = conditions_of(folder, read_simulated(folder, name))
    said = []
    for label in chosen:
        rows = [score for score in scores if score.estimator == label and score.frames]
        courses = [course(folder, score, of_frames[score.case]) for score in rows]
        found = attribute(courses)
        said.append({"estimator": label, **_attributed(rows, courses, found, worst)})
        if not json:
            _print_causes(label, rows, courses, found, worst)
    if json:
        terminal.print_json({"run": str(folder.path), "conditions": CONDITIONS, "estimators": said})


def _attributed(
    rows: Sequence[TrialScore], courses: Sequence[Course], found: Attribution | None, worst: int
) -> dict[str, Any]:
    trials = [
        {"case": c.case, "repeat": c.repeat, "status": row.status, "first_divergence_frame": c.first_divergence}
        for row, c in zip(rows, courses, strict=True)
    ]
    if found is None:
        return {"trials": trials}
    return {
        "trials": trials,
        "explained": found.explained,
        "causes": [asdict(cause) for cause in found.causes],
        "constant": found.constant,
        "cases": {case: [[c.conditions, factor] for c, factor in share] for case, share in found.cases.items()},
        "worst": [asdict(segment) for segment in found.segments[:worst]],
    }


def _print_causes(
    label: str, rows: Sequence[TrialScore], courses: Sequence[Course], found: Attribution | None, worst: int
) -> None:
    out = terminal.console()
    if found is None:
        out.print(f"{label}: too few frames, or frames too alike, to learn causes from")
        return
    table = [
        [" + ".join(c.conditions), f"{c.factor:.2f}", f"{c.low:.2f} to {c.high:.2f}", "" if c.is_sure else "not sure"]
        for c in found.causes
    ]
    title = f"{label}: the error is multiplied by, from little to much of"
    out.print(terminal.table(title, ["condition", "factor", "95 % interval", "is"], table))
    out.print(f"together they explain {found.explained:.0%} of the error's variance (of its logarithm)")
    if any(len(c.conditions) > 1 for c in found.causes):
        out.print("conditions joined by + go together in this run: no regression can tell them apart")
    if found.constant:
        out.print(f"the same in every segment, and so not known: {', '.join(found.constant)}")
    lines = []
    for row, each in zip(rows, courses, strict=True):
        at = each.first_divergence
        lines.append(
            [each.case, str(each.repeat), row.status, "" if at is None else str(at), _top(found.cases[each.case])]
        )
    out.print(terminal.table("trials", ["case", "repeat", "status", "goes wrong at", "is worse than others by"], lines))
    segments = [
        [s.case, str(s.repeat), f"{s.first} to {s.end - 1}", f"{s.loss:.1%}", _top(s.factors)]
        for s in found.segments[:worst]
    ]
    headings = ["case", "repeat", "frames", "error, of the way", "with"]
    out.print(terminal.table("worst segments", headings, segments))


def _top(shares: Sequence[tuple[Any, float]]) -> str:
    """The conditions that add most, at most three of them."""
    told = [f"{' + '.join(cause.conditions)} ×{factor:.2g}" for cause, factor in shares[:3] if factor > LEAST_TOLD]
    return ", ".join(told)


LEAST_TOLD = 1.1


def explain_command(
    trial: TrialPath,
    *,
    repeats: Seeds = 3,
    estimator: EstimatorPath = None,
    out: Out = Path("runs"),
    jobs: Jobs = 1,
    json: terminal.Json = False,
) -> None:
    """Run a trial again without each thing that makes it hard, and say which of them it fails for."""
    tried = read_trial(trial, estimator=estimator)
    found = explained(tried, repeats=repeats, out=out, jobs=jobs)
    if json:
        terminal.print_json({**asdict(found), "named": found.named})
        return
    _print_explanation(tried, found)


def explained(tried: Tried, *, repeats: int, out: Path, jobs: int) -> Explanation:
    """The explanation of a trial. Raises InputError where its case has nothing that can be removed."""
    seen = conditions_of(tried.folder, tried.case)
    nuisances = nuisances_of(tried.case, {name: float(values.max()) for name, values in seen.items()})
    if not nuisances:
        known = ", ".join(nuisance.name for nuisance in NUISANCES)
        raise InputError(f"'{tried.case.name}' has nothing that can be removed. Known: {known}")
    name = f"explain_{tried.score.case.replace('-', '_')}_{tried.score.estimator}"

    def measure(cases: Mapping[str, Case]) -> dict[str, list[Outcome]]:
        folder = run_cases(tried, cases, name=name, out=out, jobs=jobs)
        return {score.case: [outcome(folder, score)] for score in folder.scores()}

    return explain(tried.case, nuisances, measure, repeats=repeats)


def _print_explanation(tried: Tried, found: Explanation) -> None:
    out, score = terminal.console(), tried.score
    what = {nuisance.name: nuisance.instead for nuisance in NUISANCES}
    everything = found.everything

    def row(change: Change, instead: str) -> list[str]:
        ended = f"{change.survived} of {change.repeats}"
        part = f"{change.mended:.0%}", f"{change.low:.0%} to {change.high:.0%}"
        return [" and ".join(change.removed), instead, f"{change.loss:.1%}", *part, ended, _verdict(change, everything)]

    headings = ["without", "instead", "error", "less", "95 % interval", "survived", "is"]
    rows = [row(change, what[change.removed[0]]) for change in found.singles]
    rows += [row(change, "") for change in found.pairs]
    if len(everything.removed) > 1:
        whole = row(everything, "")
        rows.append(["all of these", *whole[1:]])
    title = f"{score.estimator} on {score.case}: {found.status}, {found.loss:.1%} of the way wrong"
    out.print(terminal.table(title, headings, rows))
    if found.alone:
        ordered = sorted(found.alone.items(), key=lambda item: -item[1])
        told = ", ".join(f"{name} {loss:.1%}" for name, loss in ordered)
        out.print(f"no single one mends it; with only one of them left the error is: {told}")
    if not found.repeats_differ:
        out.print("the repeats are alike, for nothing is random here: the intervals are over segments alone")
    if found.named:
        out.print(f"It fails for {' and '.join(found.named)}.")
    else:
        out.print("None of these explains it: it is the estimator, its path or what it sees.")


def _verdict(change: Change, everything: Change) -> str:
    if mends(change, everything):
        return "mends it"
    return "helps" if change.is_sure else "harms" if change.high < 0 else "no difference"


def shrink_command(
    trial: TrialPath,
    *,
    trials: Annotated[int, typer.Option(min=1, help="Estimates to run at most.")] = 12,
    save: Annotated[
        Path | None, typer.Option(help="The folder of the smaller case; shrunk/<case> where left out.")
    ] = None,
    estimator: EstimatorPath = None,
    out: Out = Path("runs"),
    jobs: Jobs = 1,
    json: terminal.Json = False,
) -> None:
    """Find the shortest part of a trial that fails in the same way, and save it as a suite of its own."""
    tried = read_trial(trial, estimator=estimator)
    if tried.score.status in ("ok", *([] if tried.score.reason else ["partial"])):
        raise InputError(f"{tried.score.estimator} on {tried.score.case} is {tried.score.status}: nothing fails")
    found = shrunk(tried, trials=trials, out=out, jobs=jobs)
    target = save or Path("shrunk") / f"{tried.score.case}_{tried.score.estimator}"
    first, end = found.window
    of = found.whole[1] - found.whole[0]
    summary = f"{tried.score.estimator}: {tried.score.status}, {tried.score.reason}"
    suite = write_case(
        found.case, [tried.entrant], target, name=f"{tried.score.case}_shrunk".replace("-", "_"), summary=summary
    )
    if json:
        terminal.print_json(
            {"suite": str(suite), "frames": [first, end], "of": of, "removed": found.removed, "tried": found.tried}
        )
        return
    console = terminal.console()
    rows = [
        [str(n), said, "fails the same way" if failed else "does not"]
        for n, (said, failed) in enumerate(found.tried, 1)
    ]
    console.print(terminal.table(f"{summary}", ["#", "tried", "result"], rows))
    also = f" and without {', '.join(found.removed)}" if found.removed else ""
    console.print(f"It still fails with frames {first} to {end - 1} of {of} ({(end - first) / of:.0%}){also}.")
    console.print(f"The smaller case: {suite}\nRun it: vobench run {suite}")


def shrunk(tried: Tried, *, trials: int, out: Path, jobs: int) -> Shrunk:
    """The smallest case that fails as the trial does."""
    wanted = Failure.of(tried.score.status, tried.score.reason)
    name = f"shrink_{tried.score.case.replace('-', '_')}_{tried.score.estimator}"

    def fails(case: Case) -> bool:
        folder = run_cases(tried, {tried.score.case: case}, name=name, out=out, jobs=jobs)
        score, *_ = folder.scores()
        return Failure.of(score.status, score.reason) == wanted

    t_ns = body_motion(tried.case).t_ns
    first, _ = tried.case.frames or (0, 0)
    likely = _likely(tried, {first + nth: stamp for nth, stamp in enumerate(t_ns.tolist())}, wanted)
    whole = (first, first + len(t_ns))
    return shrink(tried.case, whole, likely, nuisances_of(tried.case), fails, trials=trials)


def _likely(tried: Tried, stamps_ns: Mapping[int, int], wanted: Failure) -> Callable[[Window], bool]:
    """Whether the trial's own estimate of a part fails alike; where that is not told by poses, whether it began there.

    `stamps_ns` are those of the frames of the way, also of those that did not come.
    """
    gt, est, _ = _paths(tried.folder, tried.score)
    wrong_ns = next((row.t_ns for row in read_frames(tried.place) if row.status in ("", "lost")), int(gt.t_ns[0]))

    def part(path: "Trajectory", window: Window) -> "Trajectory":
        is_in = (path.t_ns >= stamps_ns[window[0]]) & (path.t_ns <= stamps_ns[window[1] - 1])
        return replace(path, t_ns=path.t_ns[is_in], T_world_frame=path.T_world_frame[is_in])

    def alike(window: Window) -> bool:
        true, found = part(gt, window), part(est, window)
        if len(true) < FEWEST_FRAMES:
            return False
        scored = score_estimate(found, true, tried.score.claims)
        return Failure.of(*status_of(Ended(kind=FINISHED, reason=""), scored, true)) == wanted

    if alike((min(stamps_ns), max(stamps_ns) + 1)):
        return alike
    return lambda window: stamps_ns[window[0]] <= wrong_ns <= stamps_ns[window[1] - 1]
