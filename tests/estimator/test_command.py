"""A program that reads a recording from files: what it wrote is matched to frames, and every failure has a status."""

import os
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from vobench.errors import SequenceError
from vobench.estimator import Frame, Status
from vobench.estimator.command import CommandProgram, rate_hz
from vobench.estimator.manifest import USUAL, Limits
from vobench.estimator.program import KEPT_ENVIRONMENT, THREADS, EstimatorFailure
from vobench.geometry.rig import LENSES, stereo_rig

RIG = stereo_rig(LENSES["paper_blender"], pitch_deg=90)
T_NS = np.arange(4) * 10**8
SOURCE = r"""
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iostream>
#include <string>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>
// dataset, out, how to fail: reads the stamps, writes a pose for each.
int main(int argc, char** argv) {
  const std::string dataset = argv[1], how = argc > 3 ? argv[3] : "";
  std::ifstream times(dataset + "/times.txt");
  std::cerr << "about to " << how << std::endl;
  if (how == "exit") return 3;
  if (how == "segfault") *static_cast<volatile int*>(nullptr) = 1;
  if (how == "write nothing") return 0;
  if (how == "sleep") std::this_thread::sleep_for(std::chrono::seconds(600));
  if (how == "grow") {
    volatile char* held = new char[500 << 20];
    for (int i = 0; i < (500 << 20); i += 4096) held[i] = 1;
    sleep(30);
  }
  if (how == "leave a child") { if (!fork()) sleep(600); }
  if (how == "let a child work") {
    const pid_t child = fork();
    if (!child) { const auto until = clock() + CLOCKS_PER_SEC * 4 / 10; while (clock() < until) {} _exit(0); }
    waitpid(child, nullptr, 0);
  }
  std::ofstream out(argv[2]);
  if (how == "write an empty file") return 0;
  out.precision(12);
  std::string t;
  for (int n = 0; times >> t; ++n) {
    if (how == "tear" && n == 2) { out << t << " 1 2 "; break; }
    if (how == "turn back" && n == 2) t = "0.0";
    if (how == "be out of step" && n == 3) t = "0.9";
    if (how == "stutter" && n == 2) t = "0.11";
    if (how == "skip" && n == 2) continue;
    if (how == "write nan" && n == 2) { out << t << " nan 0 0 0 0 0 1\n"; continue; }
    if (how == "write kitti") { out << "1 0 0 " << n << " 0 1 0 0 0 0 1 0\n"; continue; }
    if (how == "write ns") { out << n << "00000000 " << n << " 0 0 0 0 0 1\n"; continue; }
    out << t << " " << n << " 0 0 0 0 0 1\n";
  }
}
"""


@pytest.fixture(scope="session")
def folder(compiled):
    return compiled(SOURCE)


def write_times(dataset):
    (dataset / "times.txt").write_text("".join(f"{t / 1e9}\n" for t in T_NS))


def run(folder, tmp_path, *how, limits=USUAL, argv=None, write=write_times, params=None, **more):
    argv = argv or ["./run", "{dataset}", "{out}", *how]
    program = CommandProgram(
        argv, folder, log=tmp_path / "log.txt", limits=limits, t_ns=T_NS, write_dataset=write, **more
    )
    with program:
        program.start(RIG, params or {}, 7)
        return [program.process(Frame(n, t)) for n, t in enumerate(T_NS.tolist())]


@pytest.mark.parametrize("how", ["", "write kitti", "write ns", "leave a child"])
def test_each_frame_is_answered_with_what_the_program_wrote_of_it(tmp_path, folder, how):
    answers = run(folder, tmp_path, how)
    assert [answer.result.T_odom_frame[0, 3] for answer in answers] == [0, 1, 2, 3]
    assert answers[0].wall_ms > 0
    assert (tmp_path / "log.txt").read_text() == f"about to {how}\n"


def test_a_program_may_write_to_a_file_of_its_own_choice_in_its_folder(tmp_path, folder):
    answers = run(folder, tmp_path, argv=["./run", "{dataset}", "CameraTrajectory.txt"], out="CameraTrajectory.txt")
    assert [answer.result.T_odom_frame[0, 3] for answer in answers] == [0, 1, 2, 3]


def test_a_frame_without_a_pose_is_lost(tmp_path, folder):
    results = [answer.result for answer in run(folder, tmp_path, "skip")]
    assert [result.T_odom_frame is None for result in results] == [False, False, True, False]
    assert (results[2].status, results[2].reason) == (Status.LOST, "no_pose")


FAILURES = {
    "exit": ("crashed", "the process ended with exit code 3: about to exit"),
    "segfault": ("crashed", "the process ended with signal SIGSEGV: about to segfault"),
    "write nothing": ("invalid_output", "it ended well, but wrote no file {out}"),
    "write an empty file": ("lost", "it ended well, but {out} is empty"),
    "tear": (
        "invalid_output",
        "{out}:3: a pose has 8 columns (t x y z qx qy qz qw), this line has 3 (the last row: was",
    ),
    "turn back": ("invalid_output", "{out}:3: stamps must increase, but 0.0 follows 0.1"),
    "be out of step": ("invalid_output", "{out}: pose 3, stamped 0.900000000 s, is of no frame"),
    "stutter": ("invalid_output", "{out}: pose 2, stamped 0.110000000 s, is of the same frame as the one before"),
    "write nan": ("invalid_output", "{out}:3: x should be a finite number"),
}


@pytest.mark.parametrize(("how", "kind", "reason"), [(how, *said) for how, said in FAILURES.items()], ids=FAILURES)
def test_every_way_to_fail_has_its_status_and_a_reason_in_one_line(tmp_path, folder, how, kind, reason):
    with pytest.raises(EstimatorFailure) as failed:
        run(folder, tmp_path, how)
    assert failed.value.kind == kind
    assert failed.value.reason.startswith(reason)
    assert "\n" not in failed.value.reason


def test_one_that_is_late_is_stopped_at_its_limit(tmp_path, folder):
    began = time.monotonic()
    with pytest.raises(EstimatorFailure, match=r"^timeout: the whole trial took more than 0\.5 s$"):
        run(folder, tmp_path, "sleep", limits=Limits(trial_s=0.5))
    assert time.monotonic() - began < 60


def test_one_that_grows_is_stopped_at_its_limit(tmp_path, folder):
    with pytest.raises(
        EstimatorFailure, match=r"^out_of_memory: its processes hold \d+ MiB, where the limit is 100 MiB$"
    ):
        run(folder, tmp_path, "grow", limits=Limits(memory_mib=100))


def test_the_cpu_time_of_its_children_counts(tmp_path, folder):
    assert 300 < sum(answer.cpu_ms for answer in run(folder, tmp_path, "let a child work")) < 2000


@pytest.mark.parametrize(
    ("argv", "said"),
    [
        (["no_such_slam", "{out}"], "no executable 'no_such_slam' on PATH"),
        (["./gone", "{out}"], "gone cannot be started"),
    ],
)
def test_a_missing_executable_is_refused(tmp_path, folder, argv, said):
    with pytest.raises(EstimatorFailure) as failed:
        run(folder, tmp_path, argv=argv)
    assert failed.value.kind == "refused"
    assert said in failed.value.reason


def test_a_recording_that_the_layout_cannot_have_is_refused(tmp_path, folder):
    def write(_):
        raise SequenceError("no pair")

    with pytest.raises(EstimatorFailure, match=r"^refused: no pair$"):
        run(folder, tmp_path, write=write)


def test_placeholders_are_filled_in_and_nothing_goes_through_a_shell(tmp_path, folder):
    argv = [
        sys.executable,
        "-c",
        "import sys; print(sys.argv[1:])",
        "{seed}",
        "{rate_hz}",
        "-n{corners}",
        "$HOME; {seed}",
        "./a",
        "{out}",
    ]
    with pytest.raises(EstimatorFailure, match="wrote no file"):
        run(folder, tmp_path, argv=argv, params={"corners": 5})
    *words, out = eval((tmp_path / "log.txt").read_text())
    assert words == ["7", "10.0", "-n5", "$HOME; 7", str(folder / "a")]
    assert not Path(out).parent.exists()


def test_it_works_in_a_folder_of_its_own_that_is_gone_afterwards_with_few_of_our_variables(
    tmp_path, folder, monkeypatch
):
    monkeypatch.setenv("SECRET_TOKEN", "x")
    code = "import os; open('left', 'w'); print([os.getcwd(), os.listdir(), sorted(os.environ)])"
    with suppress(EstimatorFailure):
        run(folder, tmp_path, argv=[sys.executable, "-c", code, "{out}"])
    home, names, variables = eval((tmp_path / "log.txt").read_text())
    assert sorted(names) == ["dataset", "left"]
    assert not Path(home).exists()
    assert set(variables) - {"LC_CTYPE"} <= {
        *KEPT_ENVIRONMENT,
        *THREADS,
        "HOME",
        "PYTHONHASHSEED",
        "PYTHONUSERBASE",
        "TMPDIR",
    }
    assert os.environ["SECRET_TOKEN"] == "x"


def test_the_rate_is_that_of_most_frames():
    assert rate_hz(np.array([0, 1, 2, 3, 9]) * 50_000_000) == 20.0
