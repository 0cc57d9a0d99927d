"""vobench import."""

from dataclasses import dataclass
from pathlib import Path

from vobench.catalog.catalog import unknown
from vobench.cli import terminal
from vobench.dataset.files import require_free
from vobench.dataset.options import Options, Topics
from vobench.errors import UnknownNameError
from vobench.results.unfinished import unfinished

TOPICS = tuple(Topics.__dataclass_fields__)


@dataclass(frozen=True, slots=True)
class Given:
    """What was said on the command line of a recording."""

    form: str | None = None
    calibration: Path | None = None
    imu: Path | None = None
    truth: Path | None = None
    rate_hz: float | None = None
    topics: tuple[str, ...] = ()

    def options(self) -> Options:
        """The same as a reader takes it. Raises UnknownNameError for a topic that no reader looks for."""
        return Options(self.calibration, self.imu, self.truth, self.rate_hz, topics=_topics(self.topics))


def show(path: Path, out: Path, given: Given, *, as_json: bool) -> None:
    """Convert a recording into a sequence, and print what was found, assumed and dropped."""
    from vobench.dataset.read import read
    from vobench.pipeline.recorded import import_recording
    from vobench.sequence import Sequence

    require_free(out)
    recording = read(path, form=given.form, options=given.options())
    with unfinished(out.resolve().parent) as folder:
        import_recording(recording, folder)
        if out.is_dir():
            out.rmdir()
        folder.rename(out)
    frames = len(Sequence.open(out))
    if as_json:
        terminal.print_json({"form": recording.form, "path": str(out), "frames": frames, "notes": recording.notes})
        return
    for note in recording.notes:
        print(f"- {note}")
    print(f"{frames} frames of a recording in the form '{recording.form}': {out}")


def _topics(given: tuple[str, ...]) -> Topics:
    chosen = {}
    for entry in given:
        role, _, name = entry.partition("=")
        if role not in TOPICS or not name:
            raise UnknownNameError(f"--topic {entry}: {unknown('topic', role, list(TOPICS))}; as in --topic left=/cam0")
        chosen[role] = name
    return Topics(**chosen)
