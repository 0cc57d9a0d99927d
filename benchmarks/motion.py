"""What ten minutes of motion cost before anything is drawn: the drive, its poses, an IMU and the encoders.

    python benchmarks/motion.py [--minutes 10] [--repeats 3]

CPU seconds on one thread; the best of the repeats counts.
"""

import argparse
import os
import platform
import time
from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import numpy as np

from vobench.geometry.rig import PIONEER_WHEELS
from vobench.motion.drive import Drive, drive
from vobench.motion.encoder import ENCODERS, ticks
from vobench.motion.slip import SLIP_STREAMS, SLIPS
from vobench.sensor.imu import IMUS, STREAMS, ImuSettings, measure

# One thread: what a core can do. Set before numpy is loaded.
os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}


TOUR = ((1.0, 0.0), (2.0, 1.0), (0.0, 2.0), (-1.0, 1.0), (1.0, -1.0), (0.0, 0.0))
RATE_HZ = 30.0
IMU_HZ = 200.0
PLACE = {"position_m": (0.2, 0.0, 0.3), "rotation_deg": (-100.0, 0.0, -90.0)}
IMU = replace(IMUS["adis16448"], rate_hz=IMU_HZ, **PLACE)
Made = TypeVar("Made")


def generators(streams: tuple[str, ...]) -> dict[str, np.random.Generator]:
    """One generator for each stream."""
    return dict(zip(streams, np.random.default_rng(0).spawn(len(streams)), strict=True))


def tour(rounds: int) -> Drive:
    """So many rounds through the waypoints, slipping."""
    return drive(TOUR * rounds, slip=SLIPS["nominal"], rate_hz=RATE_HZ, rngs=generators(SLIP_STREAMS))


def best(work: Callable[[], Made], repeats: int) -> tuple[Made, float]:
    """What the work makes, and the shortest CPU time in seconds that it took."""
    spent = []
    for _ in range(repeats):
        began = time.process_time()
        made = work()
        spent.append(time.process_time() - began)
    return made, min(spent)


def main() -> None:
    """Measure each stage, print it and their sum."""
    parser = argparse.ArgumentParser(description="What motion and its sensors cost.")
    parser.add_argument("--minutes", type=float, default=10.0)
    parser.add_argument("--repeats", type=int, default=3)
    asked = parser.parse_args()
    one_round_s = tour(1).t_ns[-1] / 1e9
    rounds = int(np.ceil(60 * asked.minutes / one_round_s)) + 1
    run, driven_s = best(lambda: tour(rounds), asked.repeats)
    _, posed_s = best(lambda: run.motion.at(run.t_ns), asked.repeats)
    exact, exact_s = best(lambda: measure(run.motion, ImuSettings(rate_hz=IMU_HZ, **PLACE)), asked.repeats)
    _, noisy_s = best(lambda: measure(run.motion, IMU, rngs=generators(STREAMS)), asked.repeats)
    counts, counted_s = best(lambda: ticks(run.rim_rad, PIONEER_WHEELS, ENCODERS["nominal"]), asked.repeats)
    stages = {
        f"drive through {rounds * len(TOUR)} waypoints, {len(run.t_ns)} frames at {RATE_HZ:g} Hz": driven_s,
        "poses at the frames": posed_s,
        f"IMU at {IMU_HZ:g} Hz, {len(exact[0].t_ns)} readings: the truth": exact_s,
        "  and its noise": noisy_s - exact_s,
        f"encoders, {len(counts)} readings": counted_s,
    }
    print(f"Python {platform.python_version()}, numpy {np.__version__}, {os.cpu_count()} cores")
    print(f"{run.t_ns[-1] / 60e9:.1f} minutes of motion; load {os.getloadavg()[0]:.1f}")
    for name, spent_s in stages.items():
        print(f"  {name:60}{spent_s:8.2f} s")
    print(f"  {'all':60}{sum(stages.values()):8.2f} s")


if __name__ == "__main__":
    main()
