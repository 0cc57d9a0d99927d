"""What YAML may say of recordings made elsewhere."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

from vobench.errors import SuiteError
from vobench.setting import Name, OneOf, Positive, Short, settings

FILE_KEYS = ("calibration", "imu", "truth")
TOPICS = ("left", "right", "left_info", "right_info", "truth", "imu")
MOST_MATCHES = 10_000
GLOB = re.compile(r"[*?\[]")


@settings()
class Source:
    """A recording, or several by a pattern: a sequence of vobench, a dataset's folder, or a bag.

    Paths are relative to the suite's file; the form is told by content where it is not given. `calibration` and
    `imu` are Kalibr's camchain.yaml and imu.yaml, `truth` a trajectory, `rate_hz` for pictures without stamps.
    `topics` says which of a bag are meant, where its own names do not.
    """

    path: str
    name: Name | None = None
    form: str | None = None
    calibration: str | None = None
    imu: str | None = None
    truth: str | None = None
    rate_hz: Positive | None = None
    topics: dict[Annotated[str, OneOf("topic", TOPICS)], str] = field(default_factory=dict)

    def placed(self, path: Path, folder: Path) -> "Source":
        """The source of one recording, its files where they are seen from everywhere."""
        files = {key: getattr(self, key) for key in FILE_KEYS}
        placed: dict[str, Any] = {key: str(_placed(file, folder)) for key, file in files.items() if file}
        return replace(self, path=str(path), name=self.name or case_name(path), **placed)


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedCase:
    """One recording that was made elsewhere; `variant` names it on the axis `source`.

    `entry` is which of the suite's sources it is of.
    """

    name: str
    variant: dict[str, str]
    source: Source
    entry: int = 0


def as_sources(value: Any) -> Any:
    """One path or mapping stands for a list of one; a bare path for a source with nothing else to say."""
    entries = value if isinstance(value, tuple | list) else (value,)
    return tuple({"path": entry} if isinstance(entry, str) else entry for entry in entries)


SOURCES = Short(as_sources, {"anyOf": [{"type": "string"}, {"type": "object"}]})


def recorded_cases(spec: Source, folder: Path, *, entry: int = 0) -> Iterator[RecordedCase]:
    """The cases of one source; `folder` is where relative paths start. Raises SuiteError where a pattern finds none."""
    paths = _found(spec.path, folder)
    if spec.name and len(paths) > 1:
        raise SuiteError(f"{len(paths)} recordings match '{spec.path}', so one name '{spec.name}' is not enough")
    for path in paths:
        placed = spec.placed(path, folder)
        name = placed.name or case_name(path)
        yield RecordedCase(name=name, variant={"source": name}, source=placed, entry=entry)


def case_name(path: Path) -> str:
    """What a recording is called: its folder or file, in characters that are fit for a case; ASL's mav0 is no name."""
    called = path.parent if path.name == "mav0" else path
    stem = called.name if called.is_dir() else called.stem
    return re.sub(r"[^a-z0-9_.]+", "_", stem.lower()).strip("_.") or "recording"


def _found(written: str, folder: Path) -> list[Path]:
    placed = _placed(written, folder)
    if not GLOB.search(written):
        if not placed.exists():
            raise SuiteError(f"no folder or file at {placed}")
        return [placed]
    paths = _matches(written, folder)
    if not paths:
        raise SuiteError(f"no folder or file matches {placed}")
    return paths


def _matches(written: str, folder: Path) -> list[Path]:
    """What a pattern matches, sorted; `**` follows no link. Raises SuiteError where that is too much, or no pattern."""
    parts = _placed(written, folder).parts
    first = next(index for index, part in enumerate(parts) if GLOB.search(part))
    base = Path(*parts[:first])
    pattern = "/".join(parts[first:])
    shows_hidden = any(part.startswith(".") for part in parts[first:])
    found = list[Path]()
    try:
        for path in base.glob(pattern):
            is_hidden = any(part.startswith(".") for part in path.relative_to(base).parts)
            if is_hidden and not shows_hidden:
                continue
            found.append(path)
            if len(found) > MOST_MATCHES:
                raise SuiteError(f"more than {MOST_MATCHES} files and folders match '{written}'")
    except (OSError, RecursionError, ValueError) as error:
        cause = "folders are nested too deep" if isinstance(error, RecursionError) else error
        raise SuiteError(f"'{written}' cannot be searched for ({cause})") from None
    return sorted(path for path in found if path.is_dir() or not written.endswith("/"))


def _placed(written: str, folder: Path) -> Path:
    return folder.resolve() / Path(written).expanduser()
