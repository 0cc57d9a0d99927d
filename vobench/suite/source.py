"""The recordings in a suite: their settings, and their cases."""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

from vobench.errors import SuiteError
from vobench.setting import Name, OneOf, Positive, ShortForm, settings

FILE_KEYS = ("calibration", "imu", "truth")
TOPICS = ("left", "right", "left_info", "right_info", "truth", "imu")
MOST_MATCHES = 10_000  # the largest number of files and folders that a pattern may match
GLOB = re.compile(r"[*?\[]")


@settings()
class Source:
    """A recording, or several that match a pattern: sequences of vobench, dataset folders or bags.

    Paths are relative to the file of the suite. The form is detected from the content if it is not given.
    `calibration` and `imu` are Kalibr's camchain.yaml and imu.yaml.
    `truth` is a trajectory file.
    `rate_hz` is the frame rate of images without stamps.
    `topics` says which topics of a bag are used, if that is ambiguous.
    `frames` are the frames that are used, as A:B, from A to B - 1.
    """

    path: str
    name: Name | None = None
    form: str | None = None
    calibration: str | None = None
    imu: str | None = None
    truth: str | None = None
    rate_hz: Positive | None = None
    topics: dict[Annotated[str, OneOf("topic", TOPICS)], str] = field(default_factory=dict)
    frames: str | None = None

    def placed(self, path: Path, name: str, folder: Path) -> "Source":
        """The source of one recording, with its name and absolute paths. Relative paths start at `folder`."""
        files = dict[str, Any]()
        for key in FILE_KEYS:
            written_path = getattr(self, key)
            if written_path:
                files[key] = str(_absolute(written_path, folder))
        return replace(self, path=str(path), name=name, **files)


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedCase:
    """A case that is a recording.

    `variant` is its name on the axis `source`, and `entry` is its index in the suite's list.
    """

    name: str
    variant: dict[str, str]
    source: Source
    entry: int = 0


def as_sources(value: Any) -> Any:
    """The full form of the key `source`: a tuple with the mapping of each source, still to be checked.

    The key may be one source or a list of them. A path stands for a source without other keys: "a.bag" becomes
    ({"path": "a.bag"},).
    """
    entries = value if isinstance(value, tuple | list) else (value,)
    return tuple({"path": entry} if isinstance(entry, str) else entry for entry in entries)


SHORT_SOURCE_SCHEMA = {"anyOf": [{"type": "string"}, {"type": "object"}]}
SOURCES = ShortForm(as_sources, SHORT_SOURCE_SCHEMA)  # for the annotation of a suite's key


def recorded_cases(source: Source, folder: Path, *, entry: int = 0) -> Iterator[RecordedCase]:
    """The cases of one source. Relative paths start at `folder`. Raises SuiteError if there is no such recording."""
    paths = _recording_paths(source.path, folder)
    if source.name and len(paths) > 1:
        raise SuiteError(f"{len(paths)} recordings match '{source.path}', so one name '{source.name}' is not enough")
    for path in paths:
        name = source.name or case_name(path)
        placed_source = source.placed(path, name, folder)
        yield RecordedCase(name=name, variant={"source": name}, source=placed_source, entry=entry)


def case_name(path: Path) -> str:
    """The name of the case of a recording: that of its folder or file, with only valid characters.

    In the ASL layout, every recording is in a folder mav0, so the folder above it is used.
    """
    recording = path.parent if path.name == "mav0" else path
    stem = recording.name if recording.is_dir() else recording.stem
    valid_characters = re.sub(r"[^a-z0-9_.]+", "_", stem.lower())
    name = valid_characters.strip("_.")
    return name or "recording"


def _recording_paths(pattern: str, folder: Path) -> list[Path]:
    """The paths that match a path or pattern as written in a suite. Raises SuiteError if there are none."""
    absolute = _absolute(pattern, folder)
    if GLOB.search(pattern):
        paths = _matches(pattern, folder)
        if not paths:
            raise SuiteError(f"no folder or file matches {absolute}")
        return paths
    if not absolute.exists():
        raise SuiteError(f"no folder or file at {absolute}")
    return [absolute]


def _matches(pattern: str, folder: Path) -> list[Path]:
    """The paths that match a pattern, sorted. `**` does not follow links.

    Raises SuiteError if there are too many, or if the pattern is not valid.
    """
    parts = _absolute(pattern, folder).parts
    first_glob = next(index for index, part in enumerate(parts) if GLOB.search(part))
    base = Path(*parts[:first_glob])
    pattern_parts = parts[first_glob:]
    try:
        matches = list(_visible_matches(base, pattern_parts, pattern))
    except RecursionError:
        raise SuiteError(f"'{pattern}' cannot be searched for (folders are nested too deep)") from None
    except (OSError, ValueError) as error:
        raise SuiteError(f"'{pattern}' cannot be searched for ({error})") from None
    matches_only_folders = pattern.endswith("/")
    if matches_only_folders:
        matches = [path for path in matches if path.is_dir()]
    return sorted(matches)


def _visible_matches(base: Path, pattern_parts: tuple[str, ...], pattern: str) -> Iterator[Path]:
    """The matches below a folder. Hidden ones match only a pattern that begins with a dot. Raises SuiteError."""
    shows_hidden = _is_hidden(pattern_parts)
    count = 0
    for path in base.glob("/".join(pattern_parts)):
        if _is_hidden(path.relative_to(base).parts) and not shows_hidden:
            continue
        count += 1
        if count > MOST_MATCHES:
            raise SuiteError(f"more than {MOST_MATCHES} files and folders match '{pattern}'")
        yield path


def _is_hidden(parts: tuple[str, ...]) -> bool:
    """Whether a part of a path or pattern begins with a dot."""
    return any(part.startswith(".") for part in parts)


def _absolute(written: str, folder: Path) -> Path:
    """The absolute form of a path as written in a suite. `folder` is ignored if the written path is absolute."""
    return folder.resolve() / Path(written).expanduser()
