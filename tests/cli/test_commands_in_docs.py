"""Every command of the documentation runs, page by page, in a folder with the files that its reader has.

A command runs unless one of the tables below names it. Runs are shortened, since CI has minutes for all pages, and
commands in prose, which are parsed by `tests/test_examples_in_docs.py`, run only with VOBENCH_TEST_PROSE=1.
"""

import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
import trimesh

from tests.documented import PAGES, ROOT, Command, block_of, commands_of_page
from tests.test_examples_in_docs import mistake_in

slow = pytest.mark.slow  # run by `pytest -m slow`, and by CI

COMMANDS = [command for page in PAGES for command in commands_of_page(page)]
OF_VOBENCH = [command for command in COMMANDS if command.is_vobench]
OTHERS = [command for command in COMMANDS if not command.is_vobench]
ROOM_ALONE = ("--scene", "room", "--limit", "15")  # the light of the car park takes longest
TIMEOUT_S = 600
RUNS_PROSE = os.environ.get("VOBENCH_TEST_PROSE") == "1"

# --- What the words of the pages stand for ---

STANDS_FOR = {
    "GT": "groundtruth.txt",
    "EST": "est.txt",
    "A": "orbslam.txt",
    "B": "lk.txt",
    "C": "est.txt",
    "FILE": "list.txt",
    "RECORDING": "V1_01_easy",
    "PATH": "V1_01_easy",
    "SEQUENCE": "sequence",
    "OUT": "exported",
    "SUITE": "quickstart",
    "[SUITE]": "quickstart",
    "RUN": "runs/quickstart",
    "OLD": "runs/quickstart",
    "NEW": "runs/quickstart",
    "SCENE": "cell",
    "NAME": "place",
    "[ID]": "ate_trans",
    "runs/daily": "runs/quickstart",
    "runs/study/latest/cases/calib_drift-3": "runs/drift/latest/cases/calib_drift-3-room",
    "runs/quickstart/latest/unlike_eyes-3-car_park/feature_vo": "runs/quickstart/latest/unlike_eyes-3-room/feature_vo",
    "shrunk/<case>_<estimator>/suite.yaml": "shrunk/dark_lk_epipolar/suite.yaml",
}
INSTEAD = {
    "new estimator mine --command": "new estimator mine_too --command",  # `mine` exists
    "scene NAME --seeds 24 --out sheet.png": "scene place --seeds 4 --out sheet.png",  # a minute less
    "identify PATH": "identify runs/quickstart",  # a recording has no wheels
    "run SUITE --until decided --ratio 1.5 --budget 40min": "run places.yaml --until decided --ratio 1.5 --budget 1s",
    "run --until decided --fresh-units": "run places.yaml --until decided --fresh-units --budget 1s",
}
SHORTENED_BY = {"run": ROOM_ALONE, "explain": ("--repeats", "1")}
FRAMES_ALONE = ("--limit", "8")  # for suites without the places of quickstart
EXIT_CODES = {
    "run study.yaml --fail-if ate_trans.rmse > 0.2": 3,  # the dark case has no value
}

# --- What is not run ---


@dataclass(frozen=True)
class Check:
    """Why a command is not run, and the command that is run in its place.

    With `stop_at`, that command is stopped by SIGTERM once it has printed this text.
    """

    reason: str
    command: str
    stop_at: str = ""


MINUTES = "it takes many minutes"
VIEWER = "it opens a window"
INSTALLS = "as root it installs packages; .ci/bare runs it"
ORBSLAM3 = "it needs ORB-SLAM3, which examples/orbslam3/setup.py downloads"
NAME_ONLY = "it is the name of a command"

CHECKED = {
    "doctor --fix": Check(INSTALLS, "doctor"),
    "view runs/quickstart": Check(VIEWER, "view runs/quickstart --save look.rrd"),
    "view RUN": Check(VIEWER, "view runs/quickstart --save look.rrd"),
    "run worlds": Check(MINUTES, "run worlds --dry-run"),
    "run SUITE --units 24": Check(MINUTES, "run daily --units 24 --dry-run"),
    "run street --jobs 1": Check(MINUTES, "run street --dry-run"),
    "run regression -e mine": Check("it takes two minutes", "run regression -e mine --dry-run"),
    "VOBENCH_PORTABLE=1 run quickstart -e mine --jobs 1": Check(
        "its light is computed again, which takes half a minute", "run quickstart -e mine --dry-run"
    ),
    "explain runs/quickstart/latest/unlike_eyes-3-car_park/feature_vo": Check(
        MINUTES, "explain runs/quickstart/latest/unlike_eyes-3-room/feature_vo", stop_at="trials 1 to "
    ),
    "explain runs/lighting/latest/dim-noisy/lk_epipolar": Check(
        MINUTES, "explain runs/lighting/latest/dim-noisy/lk_epipolar", stop_at="trials 1 to "
    ),
    "explain RECORDING --estimate est.tum": Check(MINUTES, "explain --help"),
    "twin RECORDING --out twin": Check(MINUTES, "twin --help"),
    "twin --report twin": Check("it needs a twin, which takes many minutes", "twin --help"),
    "render SCENE --engine path --samples 256": Check("it needs the extra `path`", "render cell"),
    "run quickstart -e orbslam3_stereo -n 4 --jobs 1": Check(ORBSLAM3, "check quickstart"),
    "run quickstart -e orbslam3_mono -n 4 --jobs 1": Check(ORBSLAM3, "check quickstart"),
    "run street -e orbslam3_stereo -n 4 --jobs 1": Check(ORBSLAM3, "check street"),
    "VOBENCH_SANDBOX_READ=examples/orbslam3 run examples/orbslam3/suite.yaml": Check(
        ORBSLAM3, f"check {ROOT}/examples/orbslam3/suite.yaml"
    ),
    "score": Check(NAME_ONLY, "score --help"),
    "score --full": Check(NAME_ONLY, "score groundtruth.txt est.txt --full"),
    "--install-completion": Check("it needs an interactive shell", "--help"),
}


@dataclass(frozen=True)
class Elsewhere:
    """The file of CI that runs a command, and the text in it that does."""

    file: str
    text: str


NOT_OF_VOBENCH = {
    "pip install ./vobench-0.1.0-py3-none-any.whl": Elsewhere(".ci/install", "venv/bin/pip install -q $file"),
    "python3 -m venv .venv": Elsewhere(".ci/bare", "grep -m1 '^python3 -m venv"),
    ".venv/bin/pip install -q uv": Elsewhere(".ci/bare", "grep -m1 '^python3 -m venv"),
    ".venv/bin/uv pip install -q -p .venv -e .": Elsewhere(".ci/bare", "grep -m1 '^python3 -m venv"),
    ".venv/bin/uv pip install -q -p .venv -e .[test]": Elsewhere(".ci/run", "grep -m1 'python -m pytest' README.md"),
    ".venv/bin/uv pip install -q -p .venv -e .[docs]": Elsewhere(".ci/run", "uv pip install -q -p .venv -e '.[docs]'"),
    ".venv/bin/python -m pytest": Elsewhere(".ci/run", "grep -m1 'python -m pytest' README.md"),
    ".venv/bin/python -m pytest -m slow": Elsewhere(".ci/run", ".venv/bin/python -m pytest -m slow"),
    ".venv/bin/ruff check .": Elsewhere(".ci/run", ".venv/bin/ruff check ."),
    ".venv/bin/ruff format --check .": Elsewhere(".ci/run", ".venv/bin/ruff format --check ."),
    ".venv/bin/mypy": Elsewhere(".ci/run", ".venv/bin/mypy"),
    ".venv/bin/lint-imports": Elsewhere(".ci/run", ".venv/bin/lint-imports"),
    ".venv/bin/mkdocs serve": Elsewhere(".ci/run", ".venv/bin/mkdocs build --strict"),  # serve does not end
}
RUN_NOWHERE = {".venv/bin/python examples/orbslam3/setup.py": "it downloads ORB-SLAM3"}

# --- What the reader has ---

STUDY = """
name: study
scenes: [./closet/office.yaml]
lightings: {full: {}, dark: {lamp: {power_lm: 1}}}
rigs: {ahead: {picture_scale: 0.4, pitch_deg: 10}}
trajectories: {short: {targets_m: [[0.3, 0]], tolerance_m: 0.03, rate_hz: 5}}
cameras: {real: {sensor: mt9v034}}
estimators: [lk_epipolar, stand_still]
"""
OFFICE = """
name: office
white_cd_m2: 50
materials: {grain: {pattern: terrazzo, albedo: 0.5, contrast: 0.6, resolution_px: 64}}
room: {size_m: [2, 2, 1.5], floor: grain, wall: grain, ceiling: grain}
lamps: [{name: lamp, center_m: [0, 0, 1.4], size_m: [0.4, 0.4], power_lm: 600}]
"""
PLACES = """
name: places
scenes: [{name: place, seeds: 4}]
rigs: {down: {pitch_deg: 90, picture_scale: 0.2}}
trajectories: {tour: {kind: wander, body: pioneer, length_m: 0.5, rate_hz: 4, seed: 1}}
estimators: [wheel_odometry, {name: wheel_odometry, label: again}]
"""
DRIFT = """
include: quickstart
name: drift
scenes: [room]
rigs: {ahead: {picture_scale: 1}}
trajectories: {short: {rate_hz: 4}}
scenarios: {unlike_eyes: null, calib_drift: [3]}
spread: {over: [scene], units: 1, each: 1}
estimators: [stand_still]
"""
IMU_NOISE = """
update_rate: 200
gyroscope_noise_density: 1.0e-4
gyroscope_random_walk: 2.0e-5
accelerometer_noise_density: 2.0e-3
accelerometer_random_walk: 3.0e-3
"""
GIVEN = {  # commands that the reader of a page ran before, on other pages
    "docs/scenarios.md": ["new estimator mine"],
    "results/README.md": ["new estimator mine"],
}
NEEDED_LATER = {("docs/getting-started.md", "new estimator mine")}  # in prose, before the block that runs `mine`


@dataclass
class Workspace:
    """A folder, with a cache and an empty HOME, in which commands run."""

    folder: Path
    environment: dict[str, str]
    failures: list[str] = field(default_factory=list)
    checked: set[str] = field(default_factory=set)  # what was run in place of commands, on all pages

    def start(self, words: list[str], variables: tuple[str, ...] = ()) -> subprocess.Popen[str]:
        added = dict(variable.split("=", 1) for variable in variables)
        return subprocess.Popen(
            [sys.executable, "-m", "vobench", *words],
            cwd=self.folder,
            env=self.environment | added,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )

    def run(self, words: list[str], variables: tuple[str, ...] = (), *, code: int = 0) -> str:
        """What a command prints. A failure is remembered."""
        began = time.monotonic()
        process = self.start(words, variables)
        output, _ = process.communicate(timeout=TIMEOUT_S)
        print(f"{time.monotonic() - began:6.1f} s  vobench {shlex.join(words)}")
        if process.returncode != code:
            self.failures.append(f"vobench {shlex.join(words)}: exit code {process.returncode}\n{output[-2000:]}")
        return output

    def begin(self, words: list[str], text: str) -> None:
        """Stop a command by SIGTERM once it has printed a text."""
        process = self.start(words)
        assert process.stdout is not None
        output = ""
        for line in process.stdout:
            output += line
            if text in line:
                process.send_signal(signal.SIGTERM)
                break
        rest, _ = process.communicate(timeout=TIMEOUT_S)
        print(f"begun     vobench {shlex.join(words)}")
        if process.returncode != 128 + signal.SIGTERM:
            message = f"exit code {process.returncode} after it should have printed {text!r}"
            self.failures.append(f"vobench {shlex.join(words)}: {message}\n{(output + rest)[-2000:]}")


def environment_of(folder: Path) -> dict[str, str]:
    kept = {name: value for name, value in os.environ.items() if not name.startswith("VOBENCH_")}
    (folder / "home").mkdir()
    changed = {
        "HOME": str(folder / "home"),
        "VOBENCH_CACHE": str(folder / "cache"),
        "VOBENCH_JOBS": "1",
        "COLUMNS": "150",  # tables of the pages are that wide
    }
    return kept | changed


@pytest.fixture(scope="module")
def reader(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """A folder with runs, a recording, and files of the names that the pages use."""
    top = tmp_path_factory.mktemp("reader")
    folder = top / "work"
    folder.mkdir()
    workspace = Workspace(folder, environment_of(top))
    write_scenes_and_suites(folder)
    workspace.run(["run", "quickstart", *ROOM_ALONE])
    workspace.run(["run", "drift.yaml", "--limit", "15"])
    workspace.run(["run", "study.yaml"])
    case = folder / "runs" / "quickstart" / "latest" / "cases" / "unlike_eyes-0-room"
    shutil.copytree(case / "sequence", folder / "sequence")
    workspace.run(["export", "sequence", "V1_01_easy", "--form", "euroc"])
    workspace.run(["export", "sequence", "drive", "--form", "ros2"])
    write_bags(folder)
    write_trajectories(folder, case)
    for name in ("A.zip", "B.zip"):
        workspace.run(["bundle", "runs/quickstart", name])
    assert workspace.failures == []
    return workspace


def write_scenes_and_suites(folder: Path) -> None:
    (folder / "study.yaml").write_text(STUDY, encoding="utf-8")
    (folder / "drift.yaml").write_text(DRIFT, encoding="utf-8")
    (folder / "places.yaml").write_text(PLACES, encoding="utf-8")
    (folder / "results" / "quickstart").mkdir(parents=True)  # as in a clone
    (folder / "closet").mkdir()  # not in scenes, where it would hide the office that is built in
    (folder / "closet" / "office.yaml").write_text(OFFICE, encoding="utf-8")
    scenes = folder / "scenes"
    place = scenes / "place"
    place.mkdir(parents=True)
    (scenes / "cell.yaml").write_text(block_of("docs/scenes.md", "yaml"), encoding="utf-8")
    (place / "scene.yaml").write_text("name: place\nwhite_cd_m2: 50\ngenerator: generator.py\n", encoding="utf-8")
    (place / "generator.py").write_text(block_of("docs/scenes.md", "python", 1), encoding="utf-8")
    trimesh.creation.box((4, 3, 2.5)).export(folder / "house.glb")


def write_bags(folder: Path) -> None:
    convert = Path(sys.executable).with_name("rosbags-convert")
    subprocess.run([convert, "--src", "drive", "--dst", "drive.bag"], cwd=folder, check=True, capture_output=True)
    for name in ("part1.bag", "part2.bag"):
        shutil.copy(folder / "drive.bag", folder / name)
    shutil.copy(folder / "drive" / "camchain.yaml", folder / "camchain.yaml")
    (folder / "imu.yaml").write_text(IMU_NOISE, encoding="utf-8")


def write_trajectories(folder: Path, case: Path) -> None:
    shutil.copy(case / "ground_truth.tum", folder / "groundtruth.txt")
    files = {"orbslam.txt": "stereo_pnp", "lk.txt": "lk_epipolar", "est.txt": "lk_epipolar", "est.tum": "lk_epipolar"}
    for name, estimator in files.items():
        shutil.copy(case / "estimates" / estimator / "0" / "estimate.tum", folder / name)
    (folder / "list.txt").write_text("groundtruth.txt est.txt\ngroundtruth.txt orbslam.txt\n", encoding="utf-8")

    stamps_s = np.loadtxt(folder / "est.txt")[:, 0]
    covariances = np.tile(np.eye(6)[np.triu_indices(6)] * 1e-4, (len(stamps_s), 1))
    np.savetxt(folder / "covariance.txt", np.column_stack([stamps_s, covariances]))

    times_s = np.arange(0, 100, 0.1)
    angles_rad = 2 * np.pi * times_s / 100
    zeros = np.zeros_like(times_s)
    poses = [
        np.cos(angles_rad),
        np.sin(angles_rad),
        zeros,
        zeros,
        zeros,
        np.sin(angles_rad / 2),
        np.cos(angles_rad / 2),
    ]
    for name in ("body.tum", "long.tum"):
        np.savetxt(folder / name, np.column_stack([times_s, *poses]))


# --- Before a command, and what is expected of its output ---


def break_estimator(folder: Path) -> None:
    """Make the estimator of the reader fail as the page shows it."""
    path = folder / "estimators" / "mine" / "estimator.py"
    text = path.read_text(encoding="utf-8")
    broken = re.sub(
        r"(def process\(self, frame.*:\n)", r'\1        raise ValueError("no corners left")\n', text, count=1
    )
    assert broken != text
    path.write_text(broken, encoding="utf-8")


BEFORE = {("docs/getting-started.md", "run quickstart -e mine -e lk_epipolar"): break_estimator}
SHOWN_INSTEAD = {"unlike_eyes-1-car_park and": "unlike_eyes-0-room and"}  # in the room alone
NUMBER = re.compile(r"[-+]?\d+(\.\d+)?%?")


def stable(line: str) -> str:
    """A line without numbers, spaces, and marks of the best, which differ between processors; empty for a rule."""
    if not line.strip(" ─"):
        return ""
    return " ".join(NUMBER.sub("#", line).replace("#*", "#").split())


def missing_lines(shown: tuple[str, ...], output: str) -> list[str]:
    """The lines that a page shows and a command did not print, except for numbers."""
    printed = [stable(line) for line in output.splitlines()]
    missing = []
    for line in shown:
        expected = line
        for words, replacement in SHOWN_INSTEAD.items():
            expected = expected.replace(words, replacement)
        wanted = stable(expected)
        if wanted not in ("", "...") and not any(wanted in text for text in printed):
            missing.append(line)
    return missing


# --- The tests ---


def is_shortened(command: Command) -> bool:
    """Whether a command in prose lacks arguments, so that it can only be parsed."""
    return command.place == "prose" and command.text not in INSTEAD and mistake_in(command.arguments) != ""


def words_to_run(command: Command) -> list[str]:
    """The words of a command, with real names and fewer frames."""
    if command.text in INSTEAD:
        return shlex.split(INSTEAD[command.text])
    words = [STANDS_FOR.get(word, word) for word in command.arguments]
    if words[0] == "run" and words[1] != "quickstart":
        return words if "--limit" in words or words[1].startswith("shrunk/") else [*words, *FRAMES_ALONE]
    return [*words, *SHORTENED_BY.get(words[0], ())]


PAGES_WITH_COMMANDS = list(
    dict.fromkeys(command.page for command in OF_VOBENCH if RUNS_PROSE or command.place != "prose")
)


@slow
@pytest.mark.parametrize("page", PAGES_WITH_COMMANDS)
def test_every_command_of_a_page_runs(page: str, reader: Workspace, tmp_path: Path) -> None:
    folder = tmp_path / "work"
    shutil.copytree(reader.folder, folder, symlinks=True)
    workspace = Workspace(folder, reader.environment, checked=reader.checked)
    for given in GIVEN.get(page, ()):
        workspace.run(given.split())
    done = set[str]()
    for command in OF_VOBENCH:
        runs_in_prose = RUNS_PROSE or (page, command.text) in NEEDED_LATER
        is_left_out = command.place == "prose" and (command.text in done or not runs_in_prose)
        if command.page == page and not is_shortened(command) and not is_left_out:
            run(command, workspace)
            done.add(command.text)
    assert not workspace.failures, "\n\n".join(workspace.failures)


def run(command: Command, workspace: Workspace) -> None:
    """Run a command, or what the table has in its place unless an earlier page ran that."""
    check = CHECKED.get(command.text)
    if check is not None:
        words = check.command.split()
        if check.stop_at:
            workspace.begin(words, check.stop_at)
        elif check.command not in workspace.checked:
            workspace.run(words)
        workspace.checked.add(check.command)
        return

    before = BEFORE.get((command.page, command.text))
    if before is not None:
        before(workspace.folder)
    output = workspace.run(words_to_run(command), command.variables, code=EXIT_CODES.get(command.text, 0))
    missing = missing_lines(command.output, output)
    if missing:
        shown = "\n".join(missing)
        workspace.failures.append(f"vobench {command.text}: the page shows\n{shown}\nbut it prints\n{output}")


def test_lines_that_a_command_does_not_print_are_found_but_for_their_numbers():
    output = " case         lk_epipolar\n dim-noisy        0.0313*\ndim: lost: a pose for 41% of the frames\n"
    assert missing_lines((" case   lk_epipolar", " dim-noisy  12.5", "...", ""), output) == []
    assert missing_lines(("dim: lost: a pose for 7% of the frames",), output) == []
    assert missing_lines(("dim: crashed", " case   stereo_pnp"), output) == ["dim: crashed", " case   stereo_pnp"]


def entries() -> Iterator[tuple[str, str]]:
    """The names of tables, and the commands in them."""
    tables = {"INSTEAD": INSTEAD, "EXIT_CODES": EXIT_CODES, "CHECKED": CHECKED}
    for name, table in tables.items():
        for text in table:
            yield name, text


def test_every_entry_of_a_table_is_a_command_of_a_page():
    texts = {command.text for command in OF_VOBENCH}
    assert [entry for entry in entries() if entry[1] not in texts] == []
    places = {(command.page, command.text) for command in OF_VOBENCH}
    assert [key for key in [*BEFORE, *NEEDED_LATER] if key not in places] == []
    words = {word for command in OF_VOBENCH for word in command.words}
    assert [word for word in STANDS_FOR if word not in words] == []


def test_every_other_command_of_a_block_is_one_that_ci_runs_or_cannot_run():
    texts = {command.text for command in OTHERS}
    assert texts == {*NOT_OF_VOBENCH, *RUN_NOWHERE}
    for elsewhere in NOT_OF_VOBENCH.values():
        assert elsewhere.text in (ROOT / elsewhere.file).read_text(encoding="utf-8")


def test_most_commands_run():
    """The tables have a few exceptions, and do not grow into the rule."""
    in_blocks = [command for command in OF_VOBENCH if command.place != "prose"]
    run_in_blocks = [command for command in in_blocks if command.text not in CHECKED]
    assert len(run_in_blocks) > 0.8 * len(in_blocks)
