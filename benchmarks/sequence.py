"""What a recording costs to write and to read, beside the `mcap` library moving the same messages without a meaning.

    python benchmarks/sequence.py [--seconds 20] [--repeats 5] [--minutes 10] [--folder FOLDER]

Stereo pairs of 720 x 480 at 30 Hz, about 190 kB of PNG a picture, thirty of them over and over. The library is given
serialised messages and gives them back, in chunks packed by zstd or, as vobench writes pictures, not packed; it tests
checksums when reading, as vobench does, or nothing. Times are CPU and best of the repeats, taken by turns; the files
of `--minutes` (0: none) need 0.7 GB a minute.
"""

import argparse
import os
import platform
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from vobench.geometry.rig import LENSES, stereo_rig
from vobench.sequence import Sequence, SequenceWriter
from vobench.sequence.picture import Image

RIG = stereo_rig(LENSES["paper_blender"], pitch_deg=30)
RATE_HZ = 30
PICTURES = 30
Pair = tuple[bytes, bytes]
Message = tuple[int, int, bytes]


def main() -> None:
    """Write, read, jump about; print what it took."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=int, default=20)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--minutes", type=int, default=10)
    parser.add_argument("--folder", type=Path)
    parser.add_argument("--only", choices=("write", "read"), help="of a recording in --folder, for its memory alone")
    arguments = parser.parse_args()
    if arguments.only:
        {"write": record, "read": stream}[arguments.only](arguments.folder, arguments.seconds * RATE_HZ)
        print(re.search(r"VmHWM:\s+(\d+)", Path("/proc/self/status").read_text())[1])
        return
    print(f"{platform.machine()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    with tempfile.TemporaryDirectory(dir=arguments.folder) as folder:
        compare(Path(folder), arguments.seconds * RATE_HZ, arguments.repeats)
        if arguments.minutes:
            scale(Path(folder), arguments.minutes)


def compare(folder: Path, count: int, repeats: int) -> None:
    """Writing and reading, ours and the library's."""
    pictures = make_pictures()
    pairs = encoded_pairs()
    record(folder / "kept", count)
    schemas, messages = load(folder / "kept" / "sensors.mcap")
    for name, packing in (("raw", CompressionType.NONE), ("zstd", CompressionType.ZSTD)):
        library_write(folder / "kept" / f"{name}.mcap", schemas, messages, packing)
    megabytes = sum(len(data) for _, _, data in messages) / 1e6
    print(f"{count} pairs, {len(messages)} messages, {megabytes:.0f} MB")
    works: dict[str, Callable[[], object]] = {
        "write, mcap library": lambda: library_write(folder / "raw.mcap", schemas, messages, CompressionType.NONE),
        "write, mcap library, zstd": lambda: library_write(folder / "z.mcap", schemas, messages, CompressionType.ZSTD),
        "write, vobench, encoded": lambda: record(folder / "ours", count, pairs),
        "read, mcap library": lambda: library_read(folder / "kept" / "raw.mcap", validate=True),
        "read, mcap library, zstd": lambda: library_read(folder / "kept" / "zstd.mcap", validate=True),
        "read, mcap library, nothing tested": lambda: library_read(folder / "kept" / "raw.mcap", validate=False),
        "read, vobench, encoded": lambda: stream(folder / "kept", count),
        "write, vobench, with PNG": lambda: record_pictures(folder / "own", count, pictures),
        "read, vobench, with PNG": lambda: play(folder / "kept", count),
    }
    best = dict.fromkeys(works, float("inf"))
    for _ in range(repeats):
        for name, work in works.items():
            if name.startswith("write"):
                clear(folder)
            begun = time.process_time()
            work()
            best[name] = min(best[name], time.process_time() - begun)
    for name, spent_s in best.items():
        ratio = spent_s / best[f"{name.split(',', 1)[0]}, mcap library"]
        each = f"{1e3 * spent_s / count:6.2f} ms a pair"
        print(f"{name:34s} {each}, {count / spent_s:6.0f} pairs/s, {megabytes / spent_s:5.0f} MB/s, {ratio:5.2f} x")


def scale(folder: Path, minutes: int) -> None:
    """A long recording: memory beside that of a minute, and jumps to frames anywhere."""
    for length in (1, minutes):
        path = folder / f"{length}min"
        peaks = {only: peak_megabytes(path, only, length) for only in ("write", "read")}
        print(f"{length} minutes: peak memory " + ", ".join(f"{only} {peak:.0f} MB" for only, peak in peaks.items()))
    begun = time.perf_counter()
    sequence = Sequence.open(folder / f"{minutes}min")
    print(f"opening {minutes} minutes: {1e3 * (time.perf_counter() - begun):.1f} ms")
    numbers = np.random.default_rng(0).integers(0, len(sequence), 200).tolist()
    stamps = sequence.frame_stamps()
    for name, jump in (
        ("frame(number)", sequence.frame),
        ("frame_at(instant)", lambda number: sequence.frame_at(int(stamps[number]))),
    ):
        spent_ms = [1e3 * wall(jump, number) for number in numbers]
        print(f"{name}: median {np.median(spent_ms):.1f} ms, worst of {len(numbers)} {max(spent_ms):.1f} ms")


def wall(work: Callable[[int], object], number: int) -> float:
    """Seconds of one call."""
    begun = time.perf_counter()
    work(number)
    return time.perf_counter() - begun


def peak_megabytes(folder: Path, only: str, minutes: int) -> float:
    """Peak memory of a process of its own that writes or reads a recording."""
    command = [sys.executable, __file__, "--only", only, "--folder", str(folder), "--seconds", str(60 * minutes)]
    return int(subprocess.run(command, check=True, capture_output=True, text=True).stdout) / 1e3


def make_pictures() -> list[Image]:
    """Grey pictures of a size and an unrest as recorded ones have them."""
    rng = np.random.default_rng(0)
    height = RIG.left.height_px
    width = RIG.left.width_px
    coarse = (cv2.resize(rng.uniform(20, 230, (30, 45)), (width, height)) for _ in range(PICTURES))
    return [np.clip(field + rng.normal(0, 1.2, field.shape), 0, 255).astype(np.uint8) for field in coarse]


def encoded_pairs() -> list[Pair]:
    """The same as PNG, each with the next one beside it."""
    encoded = [cv2.imencode(".png", picture)[1].tobytes() for picture in make_pictures()]
    return list(zip(encoded, encoded[1:] + encoded[:1], strict=True))


def stamps_ns(count: int) -> Iterator[int]:
    """Instants of pairs."""
    return (index * 1_000_000_000 // RATE_HZ for index in range(count))


def record(folder: Path, count: int, pairs: list[Pair] | None = None) -> None:
    """Write pictures that are encoded already."""
    pairs = pairs or encoded_pairs()
    with SequenceWriter(folder, RIG, case_json=None) as writer:
        for index, t_ns in enumerate(stamps_ns(count)):
            writer.write_encoded_frame(t_ns, *pairs[index % PICTURES], "png")


def record_pictures(folder: Path, count: int, pictures: list[Image]) -> None:
    """Encode and write."""
    with SequenceWriter(folder, RIG, case_json=None) as writer:
        for index, t_ns in enumerate(stamps_ns(count)):
            writer.write_frame(t_ns, pictures[index % PICTURES], pictures[(index + 1) % PICTURES])


def play(folder: Path, count: int) -> None:
    """Read and decode all there is."""
    found = sum(1 for _ in Sequence.open(folder).frames())
    if found != count:
        raise ValueError(f"{found} frames of {count}")


def stream(folder: Path, count: int) -> None:
    """Read all there is as it lies in the file."""
    found = sum(1 for _ in Sequence.open(folder).encoded_frames())
    if found != count:
        raise ValueError(f"{found} frames of {count}")


def load(path: Path) -> tuple[list[tuple[str, str, bytes]], list[Message]]:
    """Topic, type and definition of each channel, and all messages: channel, stamp, bytes."""
    with path.open("rb") as file:
        reader = make_reader(file)
        summary = reader.get_summary()
        schemas = [
            (c.topic, summary.schemas[c.schema_id].name, summary.schemas[c.schema_id].data)
            for c in summary.channels.values()
        ]
        return schemas, [(c.id, m.log_time, m.data) for _, c, m in reader.iter_messages()]


def clear(folder: Path) -> None:
    """Away with what was written: giving its space back is not part of writing the next one."""
    for path in folder.rglob("*.mcap"):
        if path.parent.name != "kept":
            path.unlink()


def library_write(
    path: Path, schemas: list[tuple[str, str, bytes]], messages: list[Message], packing: CompressionType
) -> None:
    """The same messages by the library, with nothing to do but that."""
    with path.open("wb") as file:
        writer = Writer(file, compression=packing)
        writer.start(profile="ros2")
        for topic, name, definition in schemas:
            writer.register_channel(topic, "cdr", writer.register_schema(name, "ros2msg", definition))
        for channel, t_ns, data in messages:
            writer.add_message(channel, t_ns, data, t_ns)
        writer.finish()


def library_read(path: Path, *, validate: bool) -> int:
    """All messages as bytes."""
    with path.open("rb") as file:
        return sum(len(m.data) for _, _, m in make_reader(file, validate_crcs=validate).iter_messages())


if __name__ == "__main__":
    main()
