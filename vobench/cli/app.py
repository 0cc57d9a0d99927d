"""All of vobench's commands; what they need is imported when they run, so that --help is instant."""

import json as json_module
import os
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from vobench import stop
from vobench.cli import score_command, sequence_command
from vobench.cli.score_command import Json
from vobench.errors import SuiteError, VobenchError

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
    csv: Annotated[Path | None, typer.Option(help="The same with velocities and accelerations, as CSV.")] = None,
    json: Json = False,
) -> None:
    """Drive a suite's trajectories without rendering: a summary, and plots."""
    from vobench.cli import driving

    driving.show(suite, trajectory, out=out, tum=tum, csv=csv, as_json=json)


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
    from vobench.cli import rendering

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
    from vobench.cli import listing

    listing.show(kind, as_json=json)


for command in (score_command.score, score_command.diagnose, score_command.metrics):
    app.command()(command)
app.command("import")(sequence_command.import_)
app.command()(sequence_command.export)
app.command()(sequence_command.info)
app.command()(sequence_command.salvage)
app.command()(sequence_command.verify)


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
    from vobench.cli import reporting

    reporting.show(run, form=form, out=out, as_json=json)


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
    from vobench.cli import viewing

    viewing.show(run, case=case, estimator=estimator, save=save, as_json=json)


@app.command()
def doctor(
    *,
    fix: Annotated[bool, typer.Option("--fix", help="Install what is missing, where we may.")] = False,
    json: Json = False,
) -> None:
    """Say what this machine lacks, and the command that mends it."""
    from vobench.cli import doctor

    doctor.show(fix=fix, as_json=json)
