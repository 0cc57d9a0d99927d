"""vobench doctor: what this machine lacks, and the command that mends it."""

import json as json_module
import os
import re
import shutil
import subprocess
import sys
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, requires, version
from typing import Annotated, Any

import typer

from vobench import stop
from vobench.cli import terminal
from vobench.errors import MissingDependencyError
from vobench.estimator.program import sandbox_here
from vobench.rendering import mitsuba
from vobench.rendering.context import DEVICE_VARIABLE, EGL_PACKAGES, EGL_REMEDY
from vobench.runner.key import cache_folder
from vobench.runner.store import why_unwritable

DRAWING = "drawing without a display (EGL)"


@dataclass(frozen=True, slots=True)
class Check:
    """One thing looked at: what was found, and the command that mends it; what is optional may be missing."""

    check: str
    well: bool
    result: str
    remedy: str = ""
    optional: bool = False


def doctor_command(
    *,
    fix: Annotated[bool, typer.Option("--fix", help="Install what is missing, where we may.")] = False,
    json: terminal.Json = False,
) -> None:
    """Say what this machine lacks, and the command that mends it."""
    python = Check("Python", True, sys.version.split()[0])
    drawing = _drawing()
    if fix and not drawing[0].well:
        drawing = _installed_drawing()
    checks = [python, _libraries(), *drawing, _cache(), _sandbox(), _path_tracing()]
    ill = [c for c in checks if not (c.well or c.optional)]
    if json:
        terminal.print_json({"well": not ill, "checks": [asdict(c) for c in checks]})
        raise SystemExit(1 if ill else 0)  # the one object has said it all
    rows = [[_verdict(check), check.check, check.result] for check in checks]
    terminal.console().print(terminal.table("", ["", "check", "result"], rows))
    if ill:
        raise MissingDependencyError("; ".join(f"{c.check}: {c.remedy}" for c in ill))


def _verdict(check: Check) -> str:
    if check.well:
        return "ok"
    return "optional" if check.optional else "MISSING"


def _libraries() -> Check:
    """All that our distribution requires, extras aside, is installed."""
    missing = []
    for line in requires("vobench") or []:
        if "extra ==" in line:
            continue
        name = re.split(r"[^\w.-]", line, maxsplit=1)[0]
        try:
            version(name)
        except PackageNotFoundError:
            missing.append(name)
    remedy = f"run: {sys.executable} -m pip install {' '.join(missing)}"
    return Check("Python libraries", not missing, f"missing: {', '.join(missing)}" if missing else "all there", remedy)


def _drawing() -> list[Check]:
    """Whether a picture comes out right, drawn in a process of its own: a broken driver may kill it."""
    tried = stop.run([sys.executable, "-P", "-m", "vobench.rendering.self_test"])
    if tried.returncode != 0:
        last = tried.stderr.strip().splitlines()[-1:] or [f"the process that drew died with {tried.returncode}"]
        return [Check(DRAWING, False, last[0], f"run: {_as_we_are(EGL_REMEDY)}")]
    said = json_module.loads(tried.stdout)
    if "error" in said:
        result, _, remedy = said["error"].partition("; run: ")
        return [Check(DRAWING, False, result, f"run: {_as_we_are(remedy or EGL_REMEDY)}")]

    driver = "{renderer}, OpenGL {version}, device {device}".format(**said["driver"])
    devices = Check("drawing devices", True, f"{', '.join(said['devices'])}; {DEVICE_VARIABLE} chooses", optional=True)
    if not said["well"]:
        return [_wrong_picture(driver, said), devices]
    result = f"a test picture is right, by {driver}; light and truth are computed on the CPU"
    return [Check(DRAWING, True, result), devices]


def _wrong_picture(driver: str, said: dict[str, Any]) -> Check:
    """A driver that draws, but not what geometry and photometry say."""
    largest = 100 * said["largest_error"]
    result = (
        f"a test picture is wrong by up to {largest:.3g} %, stray light {said['stray_cd_m2']:.3g} cd/m², by {driver}"
    )
    remedy = f"update the driver, or set {DEVICE_VARIABLE} to another device ({', '.join(said['devices'])})"
    return Check(DRAWING, False, result, remedy)


def _as_we_are(command: str) -> str:
    return command if os.geteuid() == 0 else command.replace("apt-get", "sudo apt-get")


def _installed_drawing() -> list[Check]:
    """Install Mesa's EGL with apt where we are root, and look again."""
    if os.geteuid() != 0 or shutil.which("apt-get") is None:
        return _drawing()
    with terminal.Bars().step(f"apt-get install {' '.join(EGL_PACKAGES)}"):
        # Without a word or a question; whether it helped, the next check tells.
        environment = os.environ | {"DEBIAN_FRONTEND": "noninteractive"}
        nowhere = subprocess.DEVNULL
        for words in (["update"], ["install", "-y", "--no-install-recommends", *EGL_PACKAGES]):
            command = ["apt-get", "-qq", *words]
            subprocess.run(command, env=environment, check=False, stdin=nowhere, stdout=nowhere)
    return _drawing()


def _cache() -> Check:
    root = cache_folder()
    writable = not why_unwritable(root)
    remedy = "set VOBENCH_CACHE to a folder that can be written"
    return Check("cache", writable, str(root) if writable else f"cannot write {root}", remedy)


def _sandbox() -> Check:
    """Whether estimators can be kept from seeing the truth; they run all the same."""
    saw = sandbox_here()
    if saw.level == "full":
        return Check("sandbox for estimators", True, "they see their own files and nothing else", optional=True)
    remedy = "allow user namespaces: sysctl user.max_user_namespaces, kernel.apparmor_restrict_unprivileged_userns"
    why = f" ({saw.why})" if saw.why else ""
    seen = f"estimators can see {', '.join(saw.sees)}{why}; every trial records it"
    return Check("sandbox for estimators", False, seen, remedy, True)


def _path_tracing() -> Check:
    """Whether Mitsuba can render, tried in a process of its own: a wrong libLLVM would kill this one."""
    try:
        library = mitsuba.working_library()
    except MissingDependencyError as error:
        result, _, remedy = str(error).partition("; run: ")
        return Check("path tracing (Mitsuba)", False, f"{result}; run: {_as_we_are(remedy)}", _as_we_are(remedy), True)
    return Check("path tracing (Mitsuba)", True, f"works with {library}", optional=True)
