"""Shared memory for frames: only vobench writes it, an estimator keeps copies, and nothing is left of it."""

import os
import subprocess
import sys
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vobench.estimator import Frame
from vobench.estimator.frame_memory import NAME, READINGS_BYTES, FrameMemory, copied, frame_memory, opened_memory
from vobench.estimator.guard import descendants
from vobench.estimator.manifest import Limits
from vobench.estimator.process import EstimatorProcess
from vobench.geometry.rig import LENSES, stereo_rig

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only Linux has sealed memory")

RIG = stereo_rig(replace(LENSES["paper_blender"], width_px=64, height_px=48), pitch_deg=90)
# Keeps every frame, reports sums of the first and the latest one, and changes the latest one.
CODE = """
import os
import numpy as np
from vobench.estimator import Result
class Mine:
    def start(self, rig, params, seed):
        self.frames = []
    def process(self, frame):
        self.frames.append(frame)
        names = [os.path.realpath(f"/proc/self/fd/{name}") for name in os.listdir("/proc/self/fd")]
        stats = {
            "first": float(self.frames[0].left.sum()),
            "latest": float(frame.left.sum()),
            "right": float(frame.right.sum()),
            "shared_files": sum("vobench-frame" in name for name in names),
        }
        frame.left[:] = 0
        return Result(np.eye(4), stats=stats)
"""
# What a process that has inherited the descriptor tries. It ends with exit code 5 if the kernel refuses.
ATTACKER = """
import ctypes, mmap, os, sys
fd = int(sys.argv[1])
libc = ctypes.CDLL(None)
libc.mmap.restype = ctypes.c_void_p
address = libc.mmap(None, 4096, mmap.PROT_READ, mmap.MAP_SHARED, fd, 0)

def writable():
    return os.open(f"/proc/self/fd/{fd}", os.O_RDWR)

def require(result):
    if result:
        raise OSError

try:
    ATTACK
except OSError:
    sys.exit(5)
"""
ATTACKS = {
    "writes": "os.write(fd, b'x')",
    "writes through another descriptor": "os.write(writable(), b'x')",
    "maps it writable": "mmap.mmap(writable(), 4096)[0] = 1",
    "shrinks it": "os.ftruncate(writable(), 0)",
    "enlarges it": "os.ftruncate(writable(), 1 << 30)",
    "punches a hole": "require(libc.fallocate(writable(), 3, ctypes.c_long(0), ctypes.c_long(4096)))",
    "unprotects its mapping": "require(libc.mprotect(ctypes.c_void_p(address), 4096, 3))",
    "writes to its own memory": "os.pwrite(os.open('/proc/self/mem', os.O_RDWR), b'x', address)",
}


def picture(seed):
    return np.random.default_rng(seed).integers(0, 256, (48, 64)).astype(np.uint8)


@pytest.fixture
def process(tmp_path):
    (tmp_path / "mine.py").write_text(CODE)
    limits = Limits(start_s=60, frame_s=60)
    return EstimatorProcess.of_class(tmp_path, "mine:Mine", name="mine", log=tmp_path / "log.txt", limits=limits)


def test_what_is_written_is_read_and_a_copy_does_not_change_with_the_next_frame():
    memory = FrameMemory(100)
    view = opened_memory(os.dup(memory.descriptor))
    assert memory.write([memoryview(b"abc"), memoryview(b"defg")])
    copy = copied(view, 7)
    assert bytes(copy) == b"abcdefg"
    assert memory.write([memoryview(b"ABC")])
    assert bytes(copied(view, 7)) == b"ABCdefg"
    assert bytes(copy) == b"abcdefg"
    assert not copy.readonly
    assert not memory.write([memoryview(bytes(101))])
    memory.close()


@pytest.mark.parametrize("attack", ATTACKS.values(), ids=ATTACKS)
def test_nobody_else_can_write_or_resize_it(attack):
    memory = FrameMemory(8192)
    memory.write([memoryview(b"a" * 8192)])
    command = [sys.executable, "-c", ATTACKER.replace("ATTACK", attack), str(memory.descriptor)]
    ended = subprocess.run(command, pass_fds=[memory.descriptor], check=False)
    assert ended.returncode == 5
    assert bytes(memory._memory[:]) == b"a" * 8192
    memory.close()


@pytest.mark.parametrize("has_memory", [True, False])
def test_an_estimator_keeps_and_changes_its_own_copies(process, has_memory, monkeypatch):
    if not has_memory:
        monkeypatch.setattr("vobench.estimator.process.frame_memory", lambda _: None)
    images = [picture(seed) for seed in range(3)]
    before = [image.copy() for image in images]
    with process:
        process.start(RIG, {}, 0)
        assert (process._memory is not None) == has_memory
        for index, image in enumerate(images):
            stats = process.process(Frame(index, index, image, image)).result.stats
            expected = {"first": 0 if index else image.sum(), "latest": image.sum(), "right": image.sum()}
            assert stats == {**expected, "shared_files": 0}
    for image, copy in zip(images, before, strict=True):
        np.testing.assert_array_equal(image, copy)


def test_an_image_that_is_larger_than_the_calibration_says_goes_through_the_pipe(process):
    image = np.ones((1200, 1600), np.uint8)
    assert 2 * image.nbytes > 2 * 64 * 48 * 3 + READINGS_BYTES
    with process:
        process.start(RIG, {}, 0)
        assert process.process(Frame(0, 0, image, image)).result.stats["right"] == image.sum()
        small = picture(1)
        assert process.process(Frame(1, 1, small, small)).result.stats["right"] == small.sum()


def test_only_the_worker_maps_it_and_nothing_of_it_is_left(process):
    image = picture(0)
    count = len(os.listdir("/proc/self/fd"))
    with process:
        process.start(RIG, {}, 0)
        process.process(Frame(0, 0, image, image))
        assert holders(mapped=False) == [os.getpid()]
        assert len(set(holders(mapped=True)) - {os.getpid()}) == 1
    assert holders(mapped=False) == []
    assert not set(holders(mapped=True)) - {os.getpid()}
    assert len(os.listdir("/proc/self/fd")) == count


def holders(*, mapped):
    """The ids of processes that have a descriptor of such memory open, or have it mapped."""
    found = []
    for place in Path("/proc").glob("[0-9]*"):
        texts = []
        with suppress(OSError):
            if mapped:
                texts.append((place / "maps").read_text())
            for descriptor in () if mapped else (place / "fd").iterdir():
                with suppress(OSError):  # that of the folder itself is closed by then
                    texts.append(os.readlink(descriptor))
        if any(NAME in text for text in texts) and is_related(int(place.name)):
            found.append(int(place.name))
    return found


def is_related(pid):
    """Whether a process is this one or one of its descendants."""
    return pid in (os.getpid(), *descendants(os.getpid()))


def test_a_machine_without_such_memory_does_without(monkeypatch):
    monkeypatch.setattr("vobench.estimator.frame_memory.F_SEAL_FUTURE_WRITE", 1 << 30)
    count = len(os.listdir("/proc/self/fd"))
    assert frame_memory(RIG) is None
    assert len(os.listdir("/proc/self/fd")) == count
