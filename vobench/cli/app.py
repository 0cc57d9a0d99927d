"""All commands of vobench; what they need is imported when they run, so that --help is instant."""

import json as json_module
import os
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from vobench import stop
from vobench.errors import SuiteError, VobenchError

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
Gt = Annotated[Path, typer.Argument(metavar="GT", help="Ground truth: a file of any form, or a sequence's folder.")]
Est = Annotated[
    Path,
    typer.Argument(metavar="EST", help="Estimate: TUM, KITTI, TartanAir, EuRoC, MCAP or ROS bag, by content."),
]
Topic = Annotated[str | None, typer.Option(help="The topic with the poses, or /tf:parent.child.")]
As = Annotated[
    list[str] | None,
    typer.Option(
        help="s|ms|us|ns, xyzw|wxyz, inverse, rotations:inverse, axes:z,-x,-y, positions:y,x,z or "
        "mount:x,y,z,qx,qy,qz,qw; repeatable."
    ),
]
Times = Annotated[
    list[Path] | None,
    typer.Option(help="Stamps in seconds, one a line, for files without (KITTI); repeatable: each takes what fits it."),
]


def score_command(
    files: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="GT EST",
            help="Ground truth and estimate: TUM, KITTI, TartanAir, EuRoC, MCAP or ROS bag, by content, or the truth "
            "of a sequence's folder. Several pairs are scored one by one and all together.",
        ),
    ] = None,
    *,
    listed: Annotated[
        Path | None, typer.Option("--list", help="A file with GT and EST on each line, besides those given here.")
    ] = None,
    like: Annotated[
        str | None,
        typer.Option(help="Set what evo, kitti, rpg, tum, openvins, tartanair or tartanair_mono would."),
    ] = None,
    align: Annotated[
        str | None, typer.Option("--align", "-a", help="none, origin, se3 (our default), sim3, scale or yaw.")
    ] = None,
    align_n: Annotated[int | None, typer.Option(min=1, help="Align by the first so many matched poses.")] = None,
    delta: Annotated[
        float | None, typer.Option("--delta", "-d", help="RPE over so much, more than 0; 1 by default.")
    ] = None,
    delta_unit: Annotated[
        str | None, typer.Option("--delta-unit", "-u", help="f (frames), m, s, d (degrees) or r (radians).")
    ] = None,
    all_pairs: Annotated[
        bool | None, typer.Option("--all-pairs/--consecutive", help="RPE over all pairs, or end to end.")
    ] = None,
    pairs_from: Annotated[str | None, typer.Option(help="RPE's pairs are chosen on gt or est.")] = None,
    t_max_diff: Annotated[float | None, typer.Option(help="Poses further apart are no pair, in s; 0.01.")] = None,
    t_offset: Annotated[float | None, typer.Option(help="Added to the estimate's stamps, in s.")] = None,
    assoc: Annotated[str | None, typer.Option(help="nearest, evo, interpolate, greedy or in_order.")] = None,
    project: Annotated[
        str | None, typer.Option(help="Compare in the plane xy, xz or yz of the truth, once aligned.")
    ] = None,
    full: Annotated[bool | None, typer.Option("--full", help="Every metric, not only the headlines.")] = None,
    per_length: Annotated[
        bool, typer.Option("--per-length", help="Segments and parts over each length too; --json always has them.")
    ] = False,
    gt_topic: Topic = None,
    est_topic: Topic = None,
    gt_as: As = None,
    est_as: As = None,
    times: Times = None,
    json: Json = False,
    csv: Annotated[bool, typer.Option("--csv", help="Print CSV.")] = False,
    md: Annotated[bool, typer.Option("--md", help="Print Markdown.")] = False,
) -> None:
    """Score estimates against ground truth: ATE, RPE, segments, coverage."""
    from vobench.cli import score as scoring
    from vobench.run.trajectory_pair import TrajectorySource

    forms = [form for form, asked in (("json", json), ("csv", csv), ("md", md)) if asked]
    if len(forms) > 1:
        raise typer.BadParameter(f"choose one of --{' and --'.join(forms)}")
    paths = [*(files or ()), *(scoring.read_list(listed) if listed else ())]
    if not paths or len(paths) % 2:
        raise typer.BadParameter(
            f"files come in pairs, GT EST, but there {'is' if len(paths) == 1 else 'are'} {len(paths)}"
        )
    pairs = [
        (TrajectorySource(gt, gt_topic, tuple(gt_as or ())), TrajectorySource(est, est_topic, tuple(est_as or ())))
        for gt, est in zip(paths[::2], paths[1::2], strict=True)
    ]
    scoring.show_score(
        pairs,
        scoring.Asked(
            like, align, align_n, assoc, t_max_diff, t_offset, delta, delta_unit, all_pairs, pairs_from, full, project
        ),
        times=times or (),
        form=forms[0] if forms else "table",
        per_length=per_length,
    )


def diagnose_command(
    gt: Gt,
    est: Est,
    *,
    gt_topic: Topic = None,
    est_topic: Topic = None,
    gt_as: As = None,
    est_as: As = None,
    times: Times = None,
    json: Json = False,
) -> None:
    """Say what is wrong between two trajectories (frames, axes, scale, clocks, quaternions), and what mends it."""
    from vobench.cli import score as diagnosing
    from vobench.run.trajectory_pair import TrajectorySource

    diagnosing.show_diagnosis(
        TrajectorySource(gt, gt_topic, tuple(gt_as or ())),
        TrajectorySource(est, est_topic, tuple(est_as or ())),
        times=times or (),
        as_json=json,
    )


def metrics_command(
    metric: Annotated[str | None, typer.Argument(metavar="[ID]", help="All where left out.")] = None,
    *,
    json: Json = False,
) -> None:
    """Define a metric: formula, source, settings, and what it cannot see."""
    from vobench.cli import score as defining

    defining.show_metrics(metric, as_json=json)


Recorded = Annotated[
    Path, typer.Argument(metavar="PATH", help="A dataset's folder, a bag, or a sequence; its form is told by content.")
]
Imu = Annotated[Path | None, typer.Option(help="Kalibr's imu.yaml.")]
Truth = Annotated[Path | None, typer.Option(help="A trajectory file with the ground truth.")]
Rate = Annotated[float | None, typer.Option(help="Pictures a second, for layouts without stamps.")]
Form = Annotated[str | None, typer.Option(help="The form, where its content should not tell.")]
Calibration = Annotated[Path | None, typer.Option(help="Kalibr's camchain.yaml, where the layout has none of its own.")]
TopicOf = Annotated[
    list[str] | None,
    typer.Option("--topic", help="left=, right=, left_info=, right_info=, truth= or imu=NAME of a bag; repeatable."),
]


def import_command(
    path: Recorded,
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The folder of the new sequence.")],
    *,
    form: Form = None,
    calibration: Calibration = None,
    imu: Imu = None,
    truth: Truth = None,
    rate: Rate = None,
    topic: TopicOf = None,
    json: Json = False,
) -> None:
    """Make a sequence from a dataset's folder or a bag, and say all that was assumed or dropped."""
    from vobench.cli import sequence

    given = sequence.Given(form, calibration, imu, truth, rate, tuple(topic or ()))
    sequence.show_import(path, out, given, as_json=json)


def export_command(
    source: Annotated[
        Path, typer.Argument(metavar="SOURCE", help="The folder of a sequence, or the file of a trajectory.")
    ],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The folder or file to write, which should be new.")],
    *,
    form: Annotated[str, typer.Option(help="euroc, kitti, tum or, of a sequence, ros2.")],
    json: Json = False,
) -> None:
    """Write a sequence as EuRoC, KITTI, TUM or a ROS 2 bag, or a trajectory as their text; say all that is lost."""
    from vobench.cli import sequence

    sequence.show_export(source, out, form=form, as_json=json)


def info_command(
    path: Recorded,
    *,
    form: Form = None,
    calibration: Calibration = None,
    imu: Imu = None,
    truth: Truth = None,
    rate: Rate = None,
    topic: TopicOf = None,
    json: Json = False,
) -> None:
    """Say what is in a recording: topics, rates, duration, calibration, ground truth, hash."""
    from vobench.cli import sequence

    given = sequence.Given(form, calibration, imu, truth, rate, tuple(topic or ()))
    sequence.show_info(path, given, as_json=json)


def salvage_command(
    torn: Annotated[
        Path, typer.Argument(metavar="TORN", help="An MCAP file that was cut off, or a sequence's folder.")
    ],
    out: Annotated[Path, typer.Argument(metavar="OUT", help="The whole file or folder to write.")],
    *,
    json: Json = False,
) -> None:
    """Recover what is whole in a torn MCAP file."""
    from vobench.cli import sequence

    sequence.show_salvaged(torn, out, as_json=json)


def verify_command(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="A run's folder, or runs/<suite> for its latest.")],
    *,
    json: Json = False,
) -> None:
    """Recompute all hashes and scores of a run from its files; exit code 1 where anything differs."""
    from vobench.cli import report

    report.show_verification(run, as_json=json)


app = typer.Typer(
    name="vobench",
    help="Simulate, run and score visual odometry, and see where it breaks.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

DEBUG = "--debug"
SuiteName = Annotated[str, typer.Argument(metavar="SUITE", help="A suite's name, or a path to its YAML.")]
RunPath = Annotated[Path, typer.Argument(metavar="RUN", help="A run's folder, or runs/<suite> for its latest.")]


def run() -> None:
    """Run a command; a user's mistake or machine is one line and exit code 1."""
    for stream in filter(None, (sys.stdout, sys.stderr)):
        stream.reconfigure(errors="replace")  # a terminal without ° gets a ? for it
    try:
        # Nobody remembers whether --debug goes before the command or after it.
        app([word for word in sys.argv[1:] if word != DEBUG], prog_name=app.info.name)
    except SystemExit as end:
        if not isinstance(end.__context__, BrokenPipeError):
            raise
        _hang_up()  # a reader that has seen enough is no failure
    except (VobenchError, OSError) as error:
        stop.check()  # then it may come of that
        _fail(_sentence(error), error)
    finally:
        _flush()


def _flush() -> None:
    """Hand over what is printed now, not at exit, where a reader that has seen enough would make a traceback."""
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        _hang_up()


def _hang_up() -> None:
    """Let what is still to be printed go nowhere."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _sentence(error: BaseException) -> str:
    """One line; the system's errors with what it is about in front."""
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.strerror}: {error.filename}"
    if isinstance(error, SuiteError) and (more := len(error.mistakes) - 1):
        return f"{error.mistakes[0]} (and {more} more mistake{'s' if more > 1 else ''})"
    return " ".join(str(error).split())


def _fail(sentence: str, error: BaseException) -> None:
    if DEBUG in sys.argv:
        raise error
    if "--json" in sys.argv:
        print(json_module.dumps({"error": sentence, **_mistakes(error)}, ensure_ascii=False))
    for line in str(error).splitlines() if isinstance(error, SuiteError) else [sentence]:
        print(f"vobench: {line}", file=sys.stderr)
    raise SystemExit(1) from None


def _mistakes(error: BaseException) -> dict[str, Any]:
    """Of a file that is wrong: every mistake with its file, line, key and value; `asked_by` is what named the file."""
    if not isinstance(error, SuiteError):
        return {}
    said = list[dict[str, Any]]()
    for mistake in error.mistakes:
        place = {"file": None, "line": None, "column": None, "key": None, "value": None}
        if mistake.places:
            place = asdict(mistake.places[-1])
        asked_by = [str(outer) for outer in mistake.places[:-1]]
        said.append({**place, "sentence": mistake.sentence, "asked_by": asked_by})
    return {"mistakes": said}


def _print_version(asked: bool) -> None:
    if asked:
        from vobench import __version__

        print(__version__)
        raise typer.Exit


@app.callback()
def common(
    *,
    debug: Annotated[bool, typer.Option(DEBUG, help="Show a traceback where there would be one line.")] = False,
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", callback=_print_version, is_eager=True)
    ] = False,
) -> None:
    """Simulate, run and score visual odometry, and see where it breaks."""
    del debug, version  # the one is read by _fail, the other done by its callback


@app.command("run")
def run_command(
    suite: SuiteName,
    *,
    estimator: Annotated[
        list[str] | None, typer.Option("--estimator", "-e", help="Run only this one; may be given several times.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Where the folders of runs go.")] = Path("runs"),
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say what would be run, and stop.")] = False,
    json: Json = False,
) -> None:
    """Run a suite: simulate, estimate, score, and print the leaderboard."""
    from vobench.cli import run

    names = tuple(estimator or ())
    if dry_run:
        run.check(suite, names, as_json=json)
    else:
        run.run(suite, names, out=out, as_json=json)


@app.command()
def check(suite: SuiteName, *, json: Json = False) -> None:
    """Validate a suite and print its plan; nothing is rendered."""
    from vobench.cli import run

    run.check(suite, (), as_json=json)


@app.command()
def drive(
    suite: SuiteName,
    *,
    trajectory: Annotated[str | None, typer.Option("--trajectory", "-t", help="Only this one of the suite's.")] = None,
    out: Annotated[Path | None, typer.Option(help="Plot paths and speeds to this .svg, .png or .pdf.")] = None,
    tum: Annotated[Path | None, typer.Option(help="Write the body's true path of one trajectory, as TUM.")] = None,
    csv: Annotated[
        Path | None, typer.Option(help="The same with speeds, wheels, references and voltages, as CSV.")
    ] = None,
    json: Json = False,
) -> None:
    """Drive a suite's trajectories without rendering: a summary, and plots."""
    from vobench.cli import drive as driving

    driving.show(suite, trajectory, out=out, tum=tum, csv=csv, as_json=json)


@app.command()
def identify(
    path: Annotated[
        Path, typer.Argument(metavar="PATH", help="A run's or a sequence's folder, or a CSV file of `vobench drive`.")
    ],
    *,
    radius_m: Annotated[float | None, typer.Option(help="The wheels' radius, for a CSV; the Pioneer's.")] = None,
    track_m: Annotated[float | None, typer.Option(help="The wheels' track, for a CSV; the Pioneer's.")] = None,
    json: Json = False,
) -> None:
    """Find theta in recorded drives of the Pioneer, from its wheels and what it was asked for; say what is left."""
    from vobench.cli import identify as identifying

    identifying.show(path, radius_m=radius_m, track_m=track_m, as_json=json)


@app.command()
def render(
    scene: Annotated[str, typer.Argument(metavar="SCENE", help="A scene's name, or a path to its YAML.")],
    *,
    out: Annotated[Path, typer.Option(help="The picture to write.")] = Path("frame.png"),
    camera: Annotated[str, typer.Option(help="The left lens of this rig preset.")] = "paper_blender",
    at: Annotated[tuple[float, float, float], typer.Option(metavar="X Y Z", help="Where it stands, in metres.")] = (
        0.0,
        0.0,
        1.2,
    ),
    yaw: Annotated[float, typer.Option(help="Where it looks, in degrees: 0 along x, 90 along y.")] = 0.0,
    pitch: Annotated[float, typer.Option(help="How far below the horizon it looks, in degrees.")] = 10.0,
    time: Annotated[float, typer.Option(help="When, in seconds; lights and things may move.")] = 0.0,
    sensor: Annotated[str, typer.Option(help="The chip behind the lens.")] = "clean",
    gain: Annotated[float, typer.Option(min=1e-6, help="Multiplies the exposure.")] = 1.0,
    engine: Annotated[str, typer.Option(help="raster, or path for Mitsuba's path tracer.")] = "raster",
    samples: Annotated[int | None, typer.Option(help="Light paths a pixel, for --engine path alone.")] = None,
    truth: Annotated[bool, typer.Option("--truth", help="Write ground truth beside the picture.")] = False,
    json: Json = False,
) -> None:
    """Draw one picture of a scene, to look at and to debug scenes with."""
    from vobench.cli import render as rendering

    viewpoint = rendering.Viewpoint(at, yaw, pitch, time)
    look = rendering.Look(camera, sensor, gain, engine, samples)
    rendering.show(scene, viewpoint, look, out=out, truth=truth, as_json=json)


@app.command("list")
def list_command(
    kind: Annotated[
        str | None, typer.Argument(metavar="[suites|scenes|estimators]", help="All where left out.")
    ] = None,
    *,
    json: Json = False,
) -> None:
    """List the suites, scenes and estimators that can be found, and where."""
    from vobench.cli import list as listing

    listing.show(kind, as_json=json)


app.command("score")(score_command)
app.command("diagnose")(diagnose_command)
app.command("metrics")(metrics_command)
app.command("import")(import_command)
app.command("export")(export_command)
app.command("info")(info_command)
app.command("salvage")(salvage_command)
app.command("verify")(verify_command)


@app.command()
def report(
    run: RunPath,
    *,
    form: Annotated[
        str | None, typer.Option("--format", help="terminal, md, csv, json, latex or html; --out's ending says it too.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Write to this file instead of the terminal.")] = None,
    json: Json = False,
) -> None:
    """Print a run's leaderboard, in any form."""
    from vobench.cli import report as reporting

    reporting.show_report(run, form=form, out=out, as_json=json)


@app.command()
def view(
    run: RunPath,
    *,
    case: Annotated[
        str | None, typer.Option(help="The case; the gravest failure or the worst error where left out.")
    ] = None,
    estimator: Annotated[
        str | None, typer.Option(help="The estimator; a failed one where left out, else the best.")
    ] = None,
    save: Annotated[Path | None, typer.Option(help="Write this .rrd instead of opening the viewer.")] = None,
    json: Json = False,
) -> None:
    """Open one run in Rerun, failures first."""
    from vobench.cli import view as viewing

    viewing.show_view(run, case=case, estimator=estimator, save=save, as_json=json)


@app.command()
def doctor(
    *,
    fix: Annotated[bool, typer.Option("--fix", help="Install what is missing, where we may.")] = False,
    json: Json = False,
) -> None:
    """Say what this machine lacks, and the command that mends it."""
    from vobench.cli import doctor

    doctor.show(fix=fix, as_json=json)
