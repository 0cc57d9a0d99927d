"""How many places a difference of real estimators takes, and what a board saves by its design.

    python benchmarks/units.py runs/worlds/latest

For each pair of estimators of a run over places (as `vobench run worlds`), the standard deviation over
places of the difference of their log losses, and the number of places that a board would advise for a true ratio of
losses of 2, 1.5 and 1.3 (power 0.95, error rate 2 %):

- other places for each estimator: as if each had been measured in places of its own
- the same places, one case in each
- the same places, the mean of all cases in each
"""

import argparse
from collections.abc import Iterator
from itertools import combinations
from pathlib import Path

import numpy as np
import pandas as pd

from vobench.metric.ranking import DECIDED
from vobench.metric.significance import PairedDifference, paired_difference

RATIOS = (2.0, 1.5, 1.3)
LEAST_LOSS = 1e-4  # of a trial that is perfect
UNIT = ["place", "place_seed", "drive_seed"]


def main() -> None:
    """Print a table in Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path, help="folder of a run")
    trials = pd.read_csv(parser.parse_args().run / "trials.csv")
    trials["log_loss"] = np.log(np.maximum(1 - trials["score"], LEAST_LOSS))
    ratios = " | ".join(f"{ratio:g} ×" for ratio in RATIOS)
    print(f"| pair | design | mean ratio | standard deviation | {ratios} |")
    print("|---|---|---|---|" + "---|" * len(RATIOS))
    for pair in combinations(sorted(trials["estimator"].unique()), 2):
        for design, difference in _differences(trials, *pair):
            print(_row(" / ".join(pair), design, difference))


def _differences(trials: pd.DataFrame, first: str, second: str) -> Iterator[tuple[str, PairedDifference]]:
    """Each design, and the difference of the log losses of two estimators over places."""
    losses = trials.pivot_table(index=[*UNIT, "case"], columns="estimator", values="log_loss", dropna=False)
    both = losses[[first, second]].dropna()
    by_place = both.groupby(level=UNIT, dropna=False).mean()
    apart = float(np.sqrt(by_place.var(ddof=1).sum()))
    mean = float((by_place[first] - by_place[second]).mean())
    yield "other places for each", PairedDifference(len(by_place), mean, apart)
    one_case = both.groupby(level=UNIT, dropna=False).first()
    yield "same places, one case in each", paired_difference((one_case[first] - one_case[second]).to_numpy())
    cases = len(both) / len(by_place)
    label = f"same places, {cases:.2g} cases in each"
    yield label, paired_difference((by_place[first] - by_place[second]).to_numpy())


def _row(pair: str, design: str, difference: PairedDifference) -> str:
    """A row of the table."""
    needed = [difference.units_needed(float(np.log(ratio)), DECIDED) for ratio in RATIOS]
    numbers = " | ".join(str(number) for number in needed)
    return f"| {pair} | {design} | {np.exp(difference.mean):.2f} | {difference.std:.2f} | {numbers} |"


if __name__ == "__main__":
    main()
