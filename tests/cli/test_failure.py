"""causes, explain and shrink, on an estimator that noise makes blind."""

from collections.abc import Callable
from pathlib import Path

import pytest

from tests.cli.conftest import Said

pytestmark = pytest.mark.slow  # run by `pytest -m slow`, and by CI

BLIND = '''
import numpy as np
from vobench.estimator import Result, Status

class Blind:
    def start(self, rig, params, seed):
        self._metres_per_tick = 2 * np.pi * rig.wheels.radius_m / rig.wheels.ticks_per_revolution

    def process(self, frame):
        """The wheels' way straight ahead, unless neighbouring pixels differ."""
        if np.abs(np.diff(frame.left.astype(float), axis=1)).mean() > 0.5:
            return Result(None, Status.LOST, "noise")
        T = np.eye(4)
        T[0, 3] = frame.encoders.ticks[-1].mean() * self._metres_per_tick
        return Result(T)
'''
MANIFEST = "name: blind\nversion: '1'\nclass: estimator:Blind\nneeds: [mono, encoders]\npose_of: body\nsummary: Blind\n"


@pytest.fixture
def failed(vobench: Callable[..., Said], here: Path) -> str:
    """A run of the suite in which the estimator is lost, for its camera is noisy."""
    folder = here / "estimators" / "blind"
    folder.mkdir(parents=True)
    (folder / "estimator.yaml").write_text(MANIFEST)
    (folder / "estimator.py").write_text(BLIND)
    suite = here / "suites" / "tiny.yaml"
    text = suite.read_text().replace("[wheel_odometry, stand_still]", "[blind]")
    suite.write_text(text + "cameras: {noisy: {sensor: mt9v034, vignetting: 0.1, timing: {drop_share: 0.2}}}\n")
    assert vobench("run", "tiny").code == 0
    return "runs/tiny/latest/short/blind"


def test_noise_is_named_as_the_cause_and_the_failure_shrinks_to_a_suite_of_its_own(
    vobench: Callable[..., Said], failed: str, here: Path
) -> None:
    said = vobench("explain", failed, "--repeats", 1, "--json")
    assert said.code == 0, said.err
    assert said.json["named"] == ["noise"]
    assert said.json["singles"][0]["removed"] == ["noise"]
    assert said.json["singles"][0]["survived"] == 6  # with the seeds that confirm it
    assert said.json["relation"] == "one"
    shown = vobench("explain", failed, "--repeats", 1)
    assert "noise → a chip without noise" in shown.out
    assert "because the images are noisy. With a chip without noise, the error drops by" in shown.out
    assert "trials 1 to" in shown.err

    small = vobench("shrink", failed, "--trials", 2, "--save", "small", "--json").json
    first, end = small["frames"]
    assert end - first <= small["of"] / 2
    came = (here / "runs/tiny/latest/cases/short/estimates/blind/0/frames.csv").read_text().splitlines()[1:]
    assert small["of"] > len(came)  # the way has more frames than came
    assert vobench("run", "small/suite.yaml", "--json").json["cells"][0]["status"] == "lost"

    assert "too few to learn causes from" in vobench("causes", "runs/tiny").out
    (trial,) = vobench("causes", "runs/tiny", "--json").json["estimators"][0]["trials"]
    assert (trial["status"], trial["first_divergence_frame"]) == ("lost", 1)


def test_a_trial_that_is_not_there_or_fails_in_nothing_is_a_sentence(vobench: Callable[..., Said], ran: Path) -> None:
    for words, sentence in (
        (("explain", "runs/tiny/latest/long/stand_still"), "no case named 'long'"),
        (("explain", "runs/tiny/latest/short/still"), "no estimator named 'still'. Did you mean 'stand_still'?"),
        (("explain", "runs/tiny/latest/short/stand_still/7"), "no repeat 7 of stand_still"),
        (("explain", "runs/tiny/latest/short/stand_still", "--estimate", "a.tum"), "--estimate is for recordings"),
        (("explain", "runs/tiny/latest/cases/short", "--estimator", "still"), "no estimator named 'still'"),
        (("shrink", "runs/tiny/latest/short/wheel_odometry"), "of the path: nothing fails"),
    ):
        said = vobench(*words)
        assert said.code == 1
        assert sentence in said.err
        assert len(said.err.strip().splitlines()) == 1
