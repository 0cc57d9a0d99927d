"""The environment in which results are computed: processor, driver, versions and commit."""

import os
import platform
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import TypeAdapter, ValidationError

from vobench import __version__
from vobench.errors import MissingDependencyError
from vobench.portable import is_portable
from vobench.runner.folder import ENVIRONMENT, RunFolder, run_date
from vobench.runner.key import PACKAGE, library_versions

MADE_ON = "made_on.json"  # a separate file beside each result in the store
UNKNOWN = "unknown"
# The libraries whose version can change a score. Other libraries only draw or write reports.
SCORING = ("numpy", "scipy", "opencv-python-headless", "PyOpenGL", "embreex")
LIBRARIES = (*SCORING, "pyrender2", "mcap", "rosbags", "pandas", "rerun-sdk")
# The parts of vobench's repository on which a result depends.
SOURCES = ("vobench", "scenes", "estimators", "suites")
GIT_S = 10.0


# The levels of the x86-64 psABI, by the names of their flags in Linux, the highest first.
V2 = {"cx16", "lahf_lm", "popcnt", "pni", "sse4_1", "sse4_2", "ssse3"}
V3 = V2 | {"abm", "avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "movbe", "xsave"}
V4 = V3 | {"avx512bw", "avx512cd", "avx512dq", "avx512f", "avx512vl"}
X86_LEVELS = (("x86-64-v4", V4), ("x86-64-v3", V3), ("x86-64-v2", V2))
ARM_LEVELS = (("SVE2", "sve2"), ("SVE", "sve"), ("NEON", "asimd"))


@dataclass(frozen=True, slots=True, order=True)
class Processor:
    """The model of a processor, and its instruction set, by which libraries select their code."""

    model: str = UNKNOWN
    simd: str = UNKNOWN

    def __str__(self) -> str:
        return f"{self.model} ({self.simd})"


@dataclass(frozen=True, slots=True)
class Origin:
    """The processors and drivers that computed a result and its inputs; usually one of each."""

    processors: tuple[Processor, ...] = ()
    drawn_by: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Environment:
    """The environment of a run. The fields are those of `environment.json`, and are empty if they are unknown.

    `processors` and `drawn_by` are those of all results of the run, including cached ones.
    `cores` is the number of cores that the run may use, of `cores_total`.
    `commit` is that of vobench's repository, followed by `+changes` if files differ from it.
    `date` is not in the file, but is taken from the name of the run's folder.
    """

    vobench: str = ""
    commit: str = ""
    python: str = ""
    platform: str = ""
    processors: tuple[Processor, ...] = ()
    cores: int = 0
    cores_total: int = 0
    drawn_by: tuple[str, ...] = ()
    portable: bool = False
    libraries: Mapping[str, str] = field(default_factory=dict)
    timed: str = ""
    sandboxed: bool | None = None
    date: str = ""

    @property
    def processor(self) -> str:
        """The models of all processors."""
        return _joined(processor.model for processor in self.processors)

    @property
    def simd(self) -> str:
        """The instruction sets of all processors."""
        return _joined(processor.simd for processor in self.processors)

    @property
    def driver(self) -> str:
        """All graphics drivers that rendered pictures."""
        return " and ".join(self.drawn_by)

    @property
    def release(self) -> str:
        """The version of vobench, and the commit if it runs from a repository."""
        return f"vobench {self.vobench}{f' ({self.commit})' if self.commit else ''}"

    def line(self) -> str:
        """The environment in one line, without libraries that do not change scores."""
        parts = list[str]()
        if self.processors:
            parts.append(" and ".join(map(str, self.processors)))
        if self.cores:
            parts.append(f"{self.cores} of {self.cores_total} cores")
        if self.drawn_by:
            parts.append(f"drawn by {self.driver}")
        if self.portable:
            parts.append("portable")
        if self.vobench:
            parts.append(self.release)
        if self.python:
            parts.append(f"Python {self.python}")
        parts += self._scoring_libraries()
        if self.date:
            parts.append(self.date)
        return ", ".join(parts)

    def _scoring_libraries(self) -> list[str]:
        return [f"{name} {self.libraries[name]}" for name in SCORING if name in self.libraries]

    def facts(self) -> dict[str, str]:
        """The environment as columns of a table."""
        return {
            "processor": self.processor,
            "simd": self.simd,
            "cores": f"{self.cores} of {self.cores_total}" if self.cores else "",
            "drawn_by": self.driver,
            "portable": "yes" if self.portable else "no",
            "vobench": self.vobench,
            "commit": self.commit,
            "python": self.python,
            "libraries": ", ".join(self._scoring_libraries()),
            "date": self.date,
        }


ENVIRONMENTS = TypeAdapter(Environment)
ORIGINS = TypeAdapter(Origin)


def differences(old: Environment, new: Environment) -> list[str]:
    """The differences between two environments that can change scores, as `name old value → new value`."""
    old_facts = _comparable_facts(old)
    new_facts = _comparable_facts(new)
    changes = []
    for name, before in old_facts.items():
        now = new_facts[name]
        if before and now and before != now:
            changes.append(f"{name} {before} → {now}")
    return changes


def _comparable_facts(environment: Environment) -> dict[str, str]:
    """The facts that can change scores, by name; empty if they are unknown."""
    libraries = {name: environment.libraries.get(name, "") for name in SCORING}
    return {
        "processor": " and ".join(map(str, environment.processors)),
        "drawn by": environment.driver,
        "portable": str(environment.portable),
        "Python": environment.python,
        **libraries,
    }


@cache
def processor() -> Processor:
    """The processor of this machine, from /proc/cpuinfo if that exists."""
    text = ""
    with suppress(OSError):
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace")
    return parse_cpuinfo(text, platform.machine(), fallback=platform.processor())


def parse_cpuinfo(text: str, machine: str, *, fallback: str = "") -> Processor:
    """The processor that the text of /proc/cpuinfo describes. `fallback` is its model if the text has none."""
    stated = dict[str, str]()
    for line in text.splitlines():
        name, colon, value = line.partition(":")
        if colon:
            stated.setdefault(name.strip().lower(), value.strip())
    flags = set(stated.get("flags", stated.get("features", "")).split())
    return Processor(_model(stated) or fallback or UNKNOWN, _simd(flags, machine))


def _model(stated: Mapping[str, str]) -> str:
    """The name of the model, with numbers that distinguish models of the same name, and Arm models without a name."""
    numbers = [f"{name} {stated[key]}" for name, key in (("family", "cpu family"), ("model", "model")) if key in stated]
    if "model name" in stated:
        return ", ".join([stated["model name"], *numbers])
    if "cpu implementer" in stated:
        return f"Arm implementer {stated['cpu implementer']}, part {stated.get('cpu part', UNKNOWN)}"
    return ""


def _simd(flags: set[str], machine: str) -> str:
    """The highest instruction set level that the flags contain."""
    if not flags:
        return UNKNOWN
    if machine in ("aarch64", "arm64"):
        return next((name for name, flag in ARM_LEVELS if flag in flags), UNKNOWN)
    if machine in ("x86_64", "AMD64"):
        return next((name for name, needed in X86_LEVELS if needed <= flags), "x86-64-v1")
    return UNKNOWN


@cache
def commit() -> str:
    """The commit of the repository from which vobench runs, with `+changes` if files differ; empty if there is none."""
    clone = PACKAGE.parent
    if not (clone / ".git").exists():
        return ""
    named = _git(clone, "rev-parse", "--short=10", "HEAD")
    changed = _git(clone, "status", "--porcelain", "--untracked-files=no", "--", *SOURCES)
    added = _git(clone, "ls-files", "--others", "--exclude-standard", "--", "vobench")  # not a user's own estimators
    return f"{named}{'+changes' if named and (changed or added) else ''}"


def _git(clone: Path, *words: str) -> str:
    """The output of git in a repository; empty if git is missing or fails."""
    with suppress(OSError, subprocess.SubprocessError):
        done = subprocess.run(
            ["git", "-C", str(clone), *words], capture_output=True, text=True, timeout=GIT_S, check=True
        )
        return done.stdout.strip()
    return ""


def drawn_by(engine: str) -> str:
    """The software that renders the pictures of an engine on this machine: the OpenGL driver, or Mitsuba."""
    if engine == "path":
        return f"Mitsuba {library_versions('mitsuba')['mitsuba']}"
    from vobench.rendering.raster import driver_facts

    try:
        return driver_facts().name
    except MissingDependencyError:
        return UNKNOWN


def origin_here(needs: Iterable[Path], *, engine: str = "") -> Origin:
    """The origin of a result that this machine computes from other results.

    `engine` is given if it renders pictures.
    """
    before = [read_origin(folder) for folder in needs]
    own = Origin((processor(),), (drawn_by(engine),) if engine else ())
    return joined([*before, own])


def joined(origins: Iterable[Origin]) -> Origin:
    """The joint origin of several results: all processors and drivers without duplicates, sorted by name."""
    processors = set[Processor]()
    drivers = set[str]()
    for origin in origins:
        processors.update(origin.processors)
        drivers.update(origin.drawn_by)
    return Origin(tuple(sorted(processors)), tuple(sorted(drivers)))


def read_origin(folder: Path) -> Origin:
    """The origin of a result in the store; empty if an older version of vobench computed it."""
    with suppress(OSError, ValidationError):
        return ORIGINS.validate_json((folder / MADE_ON).read_bytes())
    return Origin()


def environment(origin: Origin, *, timed: str, sandboxed: bool) -> dict[str, Any]:
    """The content of a run's `environment.json`, without date and times, so that equal runs have equal files."""
    stated = asdict(
        Environment(
            vobench=__version__,
            commit=commit(),
            python=sys.version.split()[0],
            platform=platform.platform(),
            processors=origin.processors or (processor(),),
            cores=len(os.sched_getaffinity(0)),
            cores_total=os.cpu_count() or 0,
            drawn_by=origin.drawn_by,
            portable=is_portable(),
            libraries=library_versions(*LIBRARIES),
            timed=timed,
            sandboxed=sandboxed,
        )
    )
    del stated["date"]
    return stated


def read_environment(folder: RunFolder) -> Environment | None:
    """The environment of a run, with its date; None if the run does not contain it."""
    try:
        stated = ENVIRONMENTS.validate_json((folder.path / ENVIRONMENT).read_bytes())
    except (OSError, ValidationError):
        return None
    date = run_date(folder)
    return replace(stated, date=date) if date else stated


def merged_environment(environments: Sequence[Environment]) -> dict[str, Any]:
    """The joint environment of several runs: all processors, drivers and versions."""
    origin = joined(Origin(each.processors, each.drawn_by) for each in environments)
    are_portable = bool(environments) and all(each.portable for each in environments)

    def text(name: str) -> str:
        return _joined(getattr(each, name) for each in environments)

    merged = Environment(
        vobench=text("vobench"),
        commit=text("commit"),
        python=text("python"),
        platform=text("platform"),
        processors=origin.processors,
        drawn_by=origin.drawn_by,
        portable=are_portable,
        libraries=_merged_libraries(environments),
        timed=text("timed"),
        date=text("date"),
    )
    return asdict(merged)


def _merged_libraries(environments: Sequence[Environment]) -> dict[str, str]:
    versions = defaultdict[str, list[str]](list)
    for environment in environments:
        for name, version in environment.libraries.items():
            versions[name].append(version)
    return {name: _joined(its_versions) for name, its_versions in versions.items()}


def _joined(texts: Iterable[str]) -> str:
    """The texts that are not empty, without duplicates, joined."""
    return " and ".join(dict.fromkeys(filter(None, texts)))
