"""Frames on standard input, poses on standard output: what comes back is checked, and every failure has a status."""

import sys
import time
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from vobench.estimator import EncoderReadings, Frame, ImuReadings, Status
from vobench.estimator.manifest import Limits
from vobench.estimator.process import EstimatorProcess
from vobench.estimator.program import EstimatorFailure
from vobench.geometry.rig import LENSES, stereo_rig

# ruff: noqa: E501 - one way to fail is one line

EXAMPLES = Path(__file__).parents[2] / "examples"
RIG = stereo_rig(LENSES["paper_blender"], pitch_deg=90)
HEAD = """
import json, os, struct, sys, time
read = sys.stdin.buffer.read
def send(tag, payload=b"", length=None):
    head = struct.pack("<4sI", tag, len(payload) if length is None else length)
    sys.stdout.buffer.write(head + payload); sys.stdout.buffer.flush()
def take():
    tag, length = struct.unpack("<4sI", read(8))
    return tag, read(length)
POSE = struct.pack("<12d", 1, 0, 0, 1, 0, 1, 0, 2, 0, 0, 1, 3)
def answer(index, status=1, what=1, rest=POSE): send(b"POSE", struct.pack("<qII", index, status, what) + rest)
"""
START = "tag, said = take(); said = json.loads(said); send(b'REDY')\n"
FIRST = START + "tag, frame = take(); index = struct.unpack_from('<q', frame)[0]\n"
LIMITS = Limits(start_s=20, frame_s=10)


@contextmanager
def running(tmp_path, body, *, limits=LIMITS, argv=None):
    (tmp_path / "client.py").write_text(HEAD + body)
    argv = argv or [sys.executable, "./client.py"]
    with EstimatorProcess.of_stream(argv, tmp_path, log=tmp_path / "log.txt", limits=limits, rate_hz=10.0) as program:
        program.start(RIG, {"speed": 2.0}, 7)
        yield program


def frame(index=0):
    picture = np.arange(48 * 64, dtype=np.uint8).reshape(48, 64)
    return Frame(index, index * 10**8, picture, picture + 1)


FAILURES = {
    "exits with 3": ("print('no GPU', file=sys.stderr); sys.exit(3)", "crashed", "the process ended with exit code 3: no GPU"),
    "aborts": ("os.abort()", "crashed", "the process ended with signal SIGABRT"),
    "is killed": ("os.kill(os.getpid(), 9)", "out_of_memory", "killed by the system"),
    "answers nothing and ends": ("sys.exit(0)", "invalid_output", "frame 0: it ended, with exit code 0"),
    "breaks off": ("send(b'POSE', b'12345', 112); sys.exit(0)", "invalid_output", "frame 0: it ended, with exit code 0: its answer breaks off after 5 of 112 bytes"),
    "breaks off and dies": ("send(b'POSE', b'1', 112); sys.exit(4)", "crashed", "the process ended with exit code 4: its answer breaks off"),
    "prints": ("print('hello, world'); sys.stdout.flush()", "invalid_output", "frame 0: it should answer POSE, but says b'hell' and"),
    "answers another frame": ("answer(index + 1)", "invalid_output", "frame 0: the answer is to frame 1"),
    "says too little": ("answer(index, rest=POSE[:40])", "invalid_output", "frame 0: a message of 56 bytes should have 112 or more"),
    "promises 4 GB": ("send(b'POSE', b'', 2**32 - 1)", "invalid_output", "frame 0: it should answer POSE, but says b'POSE' and 4294967295"),
    "NaN": ("answer(index, rest=struct.pack('<12d', *[float('nan')] * 12))", "invalid_output", "frame 0: the pose should be a finite"),
    "a mirror": ("answer(index, rest=struct.pack('<12d', -1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0))", "invalid_output", "frame 0: the pose is not a rigid transform"),
    "an unknown status": ("answer(index, status=9)", "invalid_output", "frame 0: no status 9"),
    "gives up": ("send(b'FAIL', b'too dark\\nfor me')", "refused", "too dark for me"),
    "a covariance that is none": ("answer(index, what=3, rest=POSE + bytes(288))", "invalid_output", "frame 0: the covariance is not symmetric and positive definite"),
}  # fmt: skip


@pytest.mark.parametrize(("body", "kind", "reason"), FAILURES.values(), ids=FAILURES)
def test_every_way_to_fail_has_its_status_and_a_reason_in_one_line(tmp_path, body, kind, reason):
    with pytest.raises(EstimatorFailure) as failed, running(tmp_path, FIRST + body) as program:
        program.process(frame())
    assert failed.value.kind == kind
    assert failed.value.reason.startswith(reason)
    assert "\n" not in failed.value.reason


def test_a_late_answer_is_a_timeout_and_leaves_nothing_behind(tmp_path):
    began = time.monotonic()
    with (
        pytest.raises(EstimatorFailure, match=r"^timeout: no answer within 0\.3 s$"),
        running(tmp_path, FIRST + "time.sleep(600)", limits=Limits(frame_s=0.3)) as program,
    ):
        program.process(frame())
    assert time.monotonic() - began < 60


def test_one_that_is_not_ready_in_time_is_a_timeout(tmp_path):
    with (
        pytest.raises(EstimatorFailure, match=r"^timeout: no answer within 0\.5 s$"),
        running(tmp_path, "time.sleep(600)", limits=Limits(start_s=0.5)),
    ):
        pass


@pytest.mark.parametrize(
    ("argv", "said"),
    [(["no_such_vo"], "no executable 'no_such_vo' on PATH"), (["./gone"], "gone cannot be started (No such file")],
)
def test_a_missing_executable_is_refused(tmp_path, argv, said):
    with pytest.raises(EstimatorFailure) as failed, running(tmp_path, "", argv=argv):
        pass
    assert failed.value.kind == "refused"
    assert said in failed.value.reason


def test_what_it_says_arrives_in_full(tmp_path):
    body = "answer(index, 3, 3, POSE + struct.pack('<36d', *[2.0 * (i % 7 == 0) for i in range(36)]) + 'zu dunkel é'.encode())"
    with running(tmp_path, FIRST + body) as program:
        answer = program.process(frame())
    result = answer.result
    assert result.T_odom_frame[:3, 3].tolist() == [1, 2, 3]
    assert (result.status, result.reason, result.covariance.tolist()) == (
        Status.DEGRADED,
        "zu dunkel é",
        (2 * np.eye(6)).tolist(),
    )
    assert answer.wall_ms > 0


def test_a_frame_without_a_pose_is_an_answer(tmp_path):
    with running(tmp_path, FIRST + "answer(index, 4, 0, b'dark')") as program:
        result = program.process(frame()).result
    assert (result.T_odom_frame, result.status, result.reason) == (None, Status.LOST, "dark")


def test_it_gets_the_calibration_the_pictures_and_the_readings_as_the_page_says(tmp_path):
    body = """
print(json.dumps(said), file=sys.stderr, flush=True)
index, t_ns, width, height, channels, pictures, imu, encoders = struct.unpack_from("<qqIIIIII", frame)
at = 40; left = frame[at:at + width * height]; right = frame[at + width * height:at + 2 * width * height]; at += 2 * width * height
rows = [struct.unpack_from("<q6d", frame, at + 56 * k) for k in range(imu)]; at += 56 * imu
counts = [struct.unpack_from("<3q", frame, at + 24 * k) for k in range(encoders)]; at += 24 * encoders
print(json.dumps([index, t_ns, width, height, channels, pictures, left[65], right[65], rows, counts, at - len(frame)]), file=sys.stderr, flush=True)
answer(index)
"""
    readings = ImuReadings(np.array([5, 6]), np.arange(6.0).reshape(2, 3), 10 + np.arange(6.0).reshape(2, 3))
    shown = frame(3)
    with running(tmp_path, FIRST + body) as program:
        program.process(
            Frame(3, 30, shown.left, shown.right, EncoderReadings(np.array([7]), np.array([[8, 9]])), readings)
        )
    import json

    said, seen = map(json.loads, (tmp_path / "log.txt").read_text().splitlines())
    assert (said["version"], said["seed"], said["rate_hz"], said["params"]) == (1, 7, 10.0, {"speed": 2.0})
    left, right = said["cameras"]
    assert (left["model"], left["fx_px"]) == ("Pinhole", RIG.left.fx_px)
    assert np.array_equal(right["T_body_camera"], RIG.T_body_right)
    imu = [[5, 0, 1, 2, 10, 11, 12], [6, 3, 4, 5, 13, 14, 15]]
    assert seen == [3, 30, 64, 48, 1, 2, shown.left[1, 1], shown.right[1, 1], imu, [[7, 8, 9]], 0]


def test_it_may_revise_its_poses_at_the_end(tmp_path):
    body = FIRST + "answer(index); take(); send(b'REVI', struct.pack('<q', 0) + POSE); send(b'DONE')"
    with running(tmp_path, body) as program:
        program.process(frame())
        assert program.finish()[0][:3, 3].tolist() == [1, 2, 3]


@pytest.mark.parametrize("last", ["send(b'DONE')", "sys.exit(0)"])
def test_or_it_ends(tmp_path, last):
    with running(tmp_path, FIRST + f"answer(index); take(); {last}") as program:
        program.process(frame())
        assert program.finish() == {}


def test_an_end_that_fails_is_a_failure(tmp_path):
    with running(tmp_path, FIRST + "answer(index); take(); sys.exit(5)") as program:
        program.process(frame())
        with pytest.raises(EstimatorFailure, match="crashed: the process ended with exit code 5"):
            program.finish()


def test_the_cpu_time_of_its_children_counts(tmp_path):
    burn = "import time\nuntil = time.process_time() + 0.4\nwhile time.process_time() < until: pass"
    body = FIRST + f"import subprocess; subprocess.run([sys.executable, '-c', {burn!r}]); answer(index)"
    with running(tmp_path, body) as program:
        answer = program.process(frame())
    assert 300 < answer.cpu_ms < 2000


def test_the_memory_of_its_children_counts(tmp_path):
    grow = "import time; held = bytearray(b'1') * (300 << 20); time.sleep(600)"
    body = FIRST + f"import subprocess; subprocess.run([sys.executable, '-c', {grow!r}]); answer(index)"
    with (
        pytest.raises(EstimatorFailure, match=r"out_of_memory: its processes hold \d+ MiB, where the limit is 200 MiB"),
        running(tmp_path, body, limits=Limits(memory_mib=200)) as program,
    ):
        program.process(frame())


def answers_of(tmp_path, argv, folder):
    limits = Limits(start_s=20)
    with EstimatorProcess.of_stream(argv, folder, log=tmp_path / "log.txt", limits=limits, rate_hz=10.0) as program:
        program.start(RIG, {}, 0)
        answers = [program.process(frame(index)) for index in range(3)]
        assert program.finish() == {}
    return answers


def test_the_client_in_python_works(tmp_path):
    answers = answers_of(tmp_path, [sys.executable, "./stream_client.py"], EXAMPLES)
    assert all(np.array_equal(answer.result.T_odom_frame, np.eye(4)) for answer in answers)
    assert (tmp_path / "log.txt").read_text() == "cameras: 2\n"


def test_the_client_in_cpp_works(tmp_path, compiled):
    answers = answers_of(tmp_path, ["./run"], compiled((EXAMPLES / "stream_client.cpp").read_text()))
    assert all(np.array_equal(answer.result.T_odom_frame, np.eye(4)) for answer in answers)
    assert (tmp_path / "log.txt").read_text().startswith('calibration: {"version": 1,')


@pytest.mark.parametrize("client", ["stream_client.cpp", "stream_client.py"])
def test_the_clients_are_short(client):
    assert len((EXAMPLES / client).read_text().splitlines()) < 60
