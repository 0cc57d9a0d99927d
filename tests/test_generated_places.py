"""A suite of places that a stranger's generator creates, from its YAML to a board, with small pictures."""

import csv
import io
import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import pytest

from tests.generated import GENERATOR, SUITE, write_cell
from vobench.errors import VobenchError
from vobench.report import page
from vobench.report.verify import verify_run
from vobench.runner.executor import Serial
from vobench.runner.folder import RunFolder
from vobench.runner.preflight import summarize
from vobench.runner.run import run_suite
from vobench.runner.task import bake_task
from vobench.suite.plan import Plan
from vobench.suite.suite import read_plan

pytestmark = pytest.mark.slow  # light is computed for two places; run by `pytest -m slow`, and by CI
TIMES = ("times.csv", "times_hashes.json")
UNITS = {("cell.1", "tour.1"), ("cell.1", "tour.2"), ("cell.2", "tour.1"), ("cell.2", "tour.2")}


@dataclass(frozen=True, slots=True)
class Cells:
    """A folder with the suite of cells, its caches and its runs."""

    folder: Path

    def suite(self, *, generator: str = GENERATOR) -> Path:
        """The file of the suite."""
        write_cell(self.folder / "scenes" / "cell", generator)
        path = self.folder / "cells.yaml"
        path.write_text(SUITE, encoding="utf-8")
        return path

    def plan(self, changes: dict[str, str] | None = None, *, generator: str = GENERATOR) -> Plan:
        return read_plan(str(self.suite(generator=generator)), changes=changes or {})

    def run(self, plan: Plan, *, cache: str = "cache") -> RunFolder:
        """Run a plan in silence."""
        store = self.folder / cache
        root = self.folder / f"runs_{cache}"
        return run_suite(plan, {}, root=root, store=store, executor=Serial(), finish=page.write_reports)


@pytest.fixture(scope="session")
def cells(tmp_path_factory: pytest.TempPathFactory) -> Cells:
    return Cells(tmp_path_factory.mktemp("cells"))


@pytest.fixture(scope="session")
def first(cells: Cells) -> RunFolder:
    """The suite, run once on an empty cache."""
    return cells.run(cells.plan())


def trials(run: RunFolder) -> list[dict[str, str]]:
    """The rows of the table of trials."""
    return list(csv.DictReader(io.StringIO((run.path / "trials.csv").read_text(encoding="utf-8"))))


def files(run: RunFolder) -> dict[str, bytes]:
    """The files of a run that equal inputs make equal, its sequences included."""
    found = {}
    for path in sorted(run.path.rglob("*")):
        if path.is_file() and path.name not in TIMES and path.suffix != ".html" and "log" not in path.name:
            found[str(path.relative_to(run.path))] = path.read_bytes()
    return found


def sequences(run: RunFolder) -> dict[str, bytes]:
    """The messages and the truth of every case."""
    found = {}
    for case in sorted(path.name for path in (run.path / "cases").iterdir()):
        for path in sorted((run.case(case) / "sequence").resolve().glob("*.mcap")):
            found[f"{case}/{path.name}"] = path.read_bytes()
    return found


def test_every_trial_has_a_row_with_its_place_its_drive_and_their_seeds(first: RunFolder) -> None:
    rows = trials(first)
    assert len(rows) == 2 * 2 * 2  # cameras, units of each, estimators
    assert {row["status"] for row in rows} <= {"ok", "partial", "diverged"}
    for row in rows:
        assert row["place"] == f"cell.{row['place_seed']}" == row["scene"]
        assert row["trajectory"] == f"tour.{row['drive_seed']}"
        assert row["noise_seed"] == "1"
        assert row["lighting"] in ("day", "evening", "night", "overcast")
    assert {(row["scene"], row["trajectory"]) for row in rows} == UNITS


def test_all_estimators_run_in_the_same_units_and_each_camera_in_two_places(first: RunFolder) -> None:
    rows = trials(first)
    units = {}
    for row in rows:
        units.setdefault((row["estimator"], row["camera"]), set()).add((row["scene"], row["trajectory"]))
    for camera in ("clean", "noisy"):
        assert units["stand_still", camera] == units["wheel_odometry", camera]
        assert {scene for scene, _ in units["stand_still", camera]} == {"cell.1", "cell.2"}


def test_the_board_counts_units_and_places_and_names_the_base_seed(first: RunFolder) -> None:
    sentence = "The cases with seeds are in 4 units (a drive in a place) in 2 places; the base seed is 0."
    assert sentence in (first.path / "leaderboard.md").read_text(encoding="utf-8")
    assert sentence in json.dumps(json.loads((first.path / "leaderboard.json").read_text(encoding="utf-8")))


def test_a_run_in_generated_places_verifies(first: RunFolder) -> None:
    assert [finding for finding in verify_run(first) if finding.wrong] == []


def test_the_same_seeds_give_the_same_bytes_on_another_empty_cache(cells: Cells, first: RunFolder) -> None:
    again = cells.run(cells.plan(), cache="again")
    assert sequences(again)
    assert sequences(again) == sequences(first)
    assert files(again) == files(first)


def test_fresh_units_are_other_places_and_drives_and_the_board_names_their_base_seed(cells: Cells) -> None:
    plan = cells.plan({"base_seed": "70000"})
    assert {case.variant["scene"] for case in plan.simulated} == {"cell.70001", "cell.70002"}
    assert {case.variant["trajectory"] for case in plan.simulated} == {"tour.70001", "tour.70002"}


def test_a_dry_run_runs_no_generator_and_a_check_runs_them_all(cells: Cells) -> None:
    plan = cells.plan(generator="raise ValueError('it ran')\n")
    summarize(plan, with_stages=True)
    with pytest.raises(VobenchError, match=r"generator\.py: ValueError: it ran"):
        summarize(plan)


def light_key(plan: Plan) -> str:
    """The key of the light of the plan's first place, of which the generator is read now."""
    return bake_task(plan.simulated[0].scene).key


def test_light_is_computed_again_when_the_generator_the_seed_or_the_lighting_changes(cells: Cells) -> None:
    thick = GENERATOR.replace("WALL_M = 0.1", "WALL_M = 0.2")
    keys = [
        light_key(cells.plan()),
        light_key(cells.plan({"base_seed": "5"})),
        light_key(cells.plan({"scenes": "[{name: cell, seeds: 2, lighting: night}]"})),
        light_key(cells.plan(generator=thick)),
    ]
    cells.suite()
    assert len(set(keys)) == 4


RUN = "import sys; from vobench.cli import main; sys.argv = {words!r}; main()"


def killed_while_it_simulates(cells: Cells, cache: str) -> None:
    """Run the suite on an empty cache, and kill it as soon as a sequence is under way."""
    words = ["vobench", "run", str(cells.suite()), "--out", str(cells.folder / "killed_runs"), "--jobs", "2"]
    environment = os.environ | {"VOBENCH_CACHE": str(cells.folder / cache)}
    process = subprocess.Popen(
        [sys.executable, "-c", RUN.format(words=words)],
        env=environment,
        start_new_session=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        until = time.monotonic() + 600
        while not list((cells.folder / cache).glob("sequences/.unfinished-*/*")):
            assert process.poll() is None, "the run ended before a sequence was under way"
            assert time.monotonic() < until
            time.sleep(0.02)
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def test_a_killed_run_goes_on_by_the_same_plan_and_ends_with_the_same_bytes(cells: Cells, first: RunFolder) -> None:
    killed_while_it_simulates(cells, "killed")
    assert list((cells.folder / "killed").glob("bakes/*/manifest.json"))  # at least one place's light is kept
    resumed = cells.run(cells.plan(), cache="killed")
    assert sequences(resumed) == sequences(first)
    assert files(resumed) == files(first)
    assert not list((cells.folder / "killed").rglob(".unfinished-*"))
