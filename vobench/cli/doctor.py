"""vobench doctor: finds what is missing on this machine, and the command that installs it."""

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
from vobench.cli.option import Json
from vobench.cli.progress import Bars
from vobench.errors import MissingDependencyError
from vobench.estimator.program import sandbox_here
from vobench.rendering import mitsuba
from vobench.rendering.egl_device import DEVICE_VARIABLE
from vobench.rendering.gl_library import EGL_PACKAGES, EGL_REMEDY
from vobench.runner.key import cache_folder
from vobench.runner.store import why_unwritable

# Names of checks.
DRAWING = "drawing without a display (EGL)"
SANDBOX = "sandbox for estimators"
PATH_TRACING = "path tracing (Mitsuba)"


@dataclass(frozen=True, slots=True)
class MachineCheck:
    """The result of a check, and the command that helps if it failed. Optional dependencies may be missing."""

    check: str
    well: bool
    result: str
    remedy: str = ""
    optional: bool = False


def doctor_command(
    *,
    fix: Annotated[bool, typer.Option("--fix", help="Install what is missing, if permissions allow.")] = False,
    json: Json = False,
) -> None:
    """Check what this machine lacks, and print the command that installs it."""
    checks = _all_checks(fix=fix)
    failed = [check for check in checks if not (check.well or check.optional)]
    if json:
        terminal.print_json({"well": not failed, "checks": [asdict(check) for check in checks]})
        raise SystemExit(1 if failed else 0)  # the JSON object has all remedies
    rows = [[_verdict(check), check.check, check.result] for check in checks]
    terminal.console().print(terminal.table("", ["", "check", "result"], rows))
    if failed:
        raise MissingDependencyError("; ".join(f"{check.check}: {check.remedy}" for check in failed))


def _all_checks(*, fix: bool) -> list[MachineCheck]:
    python = MachineCheck("Python", True, sys.version.split()[0])
    drawing = _check_drawing()
    if fix and not drawing[0].well:
        drawing = _install_drawing()
    return [python, _check_libraries(), *drawing, _check_cache(), _check_sandbox(), _check_path_tracing()]


def _verdict(check: MachineCheck) -> str:
    if check.well:
        return "ok"
    return "optional" if check.optional else "MISSING"


def _check_libraries() -> MachineCheck:
    """Whether all requirements of the vobench distribution, without extras, are installed."""
    missing = list[str]()
    for requirement in requires("vobench") or []:
        if "extra ==" in requirement:
            continue
        name = re.split(r"[^\w.-]", requirement, maxsplit=1)[0]
        try:
            version(name)
        except PackageNotFoundError:
            missing.append(name)
    result = f"missing: {', '.join(missing)}" if missing else "all installed"
    remedy = f"run: {sys.executable} -m pip install {' '.join(missing)}"
    return MachineCheck("Python libraries", not missing, result, remedy)


def _check_drawing() -> list[MachineCheck]:
    """Whether a test image is correct. It is rendered in a separate process, because a broken driver may crash."""
    process = stop.run([sys.executable, "-P", "-m", "vobench.rendering.self_test"])
    if process.returncode != 0:
        error_lines = process.stderr.strip().splitlines()
        result = error_lines[-1] if error_lines else f"the test process died with {process.returncode}"
        return [_failed_drawing(result, EGL_REMEDY)]
    report = json_module.loads(process.stdout)
    if "error" in report:
        result, _, remedy = report["error"].partition("; run: ")
        return [_failed_drawing(result, remedy or EGL_REMEDY)]

    driver = "{renderer}, OpenGL {version}, device {device}".format(**report["driver"])
    device_names = ", ".join(report["devices"])
    devices = MachineCheck("drawing devices", True, f"{device_names}; {DEVICE_VARIABLE} selects one", optional=True)
    if not report["well"]:
        return [_wrong_image(driver, report), devices]
    result = f"a test image is correct, with {driver}; light and truth are computed on the CPU"
    return [MachineCheck(DRAWING, True, result), devices]


def _failed_drawing(result: str, remedy: str) -> MachineCheck:
    return MachineCheck(DRAWING, False, result, f"run: {_with_sudo(remedy)}")


def _wrong_image(driver: str, report: dict[str, Any]) -> MachineCheck:
    """The check of a driver that renders, but not what geometry and photometry predict."""
    error_percent = 100 * report["largest_error"]
    stray_light = f"stray light {report['stray_cd_m2']:.3g} cd/m²"
    result = f"a test image is wrong by up to {error_percent:.3g} %, {stray_light}, with {driver}"
    remedy = f"update the driver, or set {DEVICE_VARIABLE} to another device ({', '.join(report['devices'])})"
    return MachineCheck(DRAWING, False, result, remedy)


def _with_sudo(command: str) -> str:
    """The command as this user can run it."""
    return command if os.geteuid() == 0 else command.replace("apt-get", "sudo apt-get")


def _install_drawing() -> list[MachineCheck]:
    """Install Mesa's EGL with apt if this user may, and check again."""
    if os.geteuid() != 0 or shutil.which("apt-get") is None:
        return _check_drawing()
    environment = os.environ | {"DEBIAN_FRONTEND": "noninteractive"}
    steps = (["update"], ["install", "-y", "--no-install-recommends", *EGL_PACKAGES])
    with Bars().step(f"apt-get install {' '.join(EGL_PACKAGES)}"):
        for step in steps:
            # Its exit code does not matter: the next check shows whether it helped.
            subprocess.run(
                ["apt-get", "-qq", *step],
                env=environment,
                check=False,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
            )
    return _check_drawing()


def _check_cache() -> MachineCheck:
    root = cache_folder()
    is_writable = not why_unwritable(root)
    result = str(root) if is_writable else f"cannot write {root}"
    return MachineCheck("cache", is_writable, result, "set VOBENCH_CACHE to a folder that can be written")


def _check_sandbox() -> MachineCheck:
    """Whether a sandbox can hide the ground truth from estimators. It is not required to run them."""
    sandbox = sandbox_here()
    if sandbox.level == "full":
        return MachineCheck(SANDBOX, True, "estimators see their own files and nothing else", optional=True)
    reason = f" ({sandbox.why})" if sandbox.why else ""
    result = f"estimators can see {', '.join(sandbox.sees)}{reason}; every trial records this"
    remedy = "allow user namespaces: sysctl user.max_user_namespaces, kernel.apparmor_restrict_unprivileged_userns"
    return MachineCheck(SANDBOX, False, result, remedy, optional=True)


def _check_path_tracing() -> MachineCheck:
    """Whether Mitsuba can render. It is tried in a separate process, because a wrong libLLVM would crash."""
    try:
        library = mitsuba.working_library()
    except MissingDependencyError as error:
        result, _, command = str(error).partition("; run: ")
        remedy = _with_sudo(command)
        return MachineCheck(PATH_TRACING, False, f"{result}; run: {remedy}", remedy, optional=True)
    return MachineCheck(PATH_TRACING, True, f"works with {library}", optional=True)
