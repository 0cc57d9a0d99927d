"""What the differences between the trials of a run come from: estimators, scenarios, places, drives, or the rest.

    python benchmarks/variance.py runs/daily/latest

The values are the logarithms of the losses (1 - score) in `trials.csv`. "estimator x place" is how much the order of
estimators depends on the place, beyond what both explain alone.
"""

import argparse
import csv
from pathlib import Path

import numpy as np

from vobench.metric.variance_split import Factor, variance_split

LEAST_LOSS = 1e-4  # of a trial that is perfect
PLACES = "place"


def main() -> None:
    """Read the table of trials of a run, and print the shares of its variance."""
    parser = argparse.ArgumentParser()
    parser.add_argument("run", type=Path)
    folder = parser.parse_args().run
    with (folder / "trials.csv").open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["score"]]
    losses = np.maximum([1 - float(row["score"]) for row in rows], LEAST_LOSS)
    shares = variance_split(np.log(losses), _factors(rows))
    print(f"{len(rows)} trials; standard deviation of the logarithm of the loss: {np.log(losses).std():.2f}")
    for name, share in shares.items():
        print(f"{name:20} {share:6.1%}")


def _factors(rows: list[dict[str, str]]) -> list[Factor]:
    """The factors of the trials: severities are scenarios of their own."""
    estimators = [row["estimator"] for row in rows]
    places = [row["place"] for row in rows]
    drives = [row["trajectory"] for row in rows]
    treatments = [(row["scenario"] or row["camera"], row["severity"], row["rig"]) for row in rows]
    return [
        Factor("estimator", estimators),
        Factor("scenario", treatments),
        Factor(PLACES, places),
        Factor("drive", list(zip(places, drives, strict=True)), within=(PLACES,)),
        Factor("estimator x place", list(zip(estimators, places, strict=True)), within=("estimator", PLACES)),
    ]


if __name__ == "__main__":
    main()
