"""What the severities of scenarios do: how the errors of estimators grow, and which channels of a recording change.

    vobench run benchmarks/severities.yaml
    python benchmarks/severities.py runs/severities/latest [--channels]

Likewise for benchmarks/severities_outdoors.yaml, with the scenarios that need open air, severities_paths.yaml, with
those that keep a path of their own, severities_lamps.yaml, with those of lamps, and severities_fusion.yaml, with those
of IMU and wheels.

For each scenario and estimator, the table has the loss (1 - score) at each severity, as the geometric mean over the
units of the scenario that have all its severities, Spearman's correlation of severity and mean loss, the share of units
whose loss grows from the lowest severity to the highest, and the factor of the loss from one severity to the next.

`--channels` instead compares the recordings of a scenario in each unit with that of its lowest severity, and prints the
topics whose messages differ and those whose messages are all the same bytes.
"""

import argparse
import hashlib
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
from mcap.reader import make_reader
from numpy.typing import NDArray
from scipy.stats import spearmanr

from vobench.runner.folder import SEQUENCE, open_run

LEAST_LOSS = 1e-4  # of a trial that is perfect
RISING = 0.9  # Spearman's correlation from which a loss counts as rising
STEP_RATIOS = (1.5, 6.0)  # of the losses of successive severities


def main() -> None:
    """Print a table in Markdown."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path, help="folder of a run")
    parser.add_argument("--channels", action="store_true")
    options = parser.parse_args()
    if options.channels:
        _print_channels(options.run)
    else:
        _print_losses(pd.read_csv(options.run / "trials.csv"))


def _unit(case: str) -> str:
    """The place and the drive in the name of a case, as in noise-3-room.1-robot; its own place has no name."""
    return "-".join(case.split("-")[2:]) or "own place"


# --- Losses ---


def _print_losses(trials: pd.DataFrame) -> None:
    """The table of losses, and how many scenarios affect one of the estimators."""
    trials["log_loss"] = np.log(np.maximum(1 - trials["score"], LEAST_LOSS))
    trials["unit"] = trials["case"].map(_unit)
    print("| scenario | estimator | units | loss by severity | Spearman | of units that rise | steps |")
    print("|---|---|---|---|---|---|---|")
    is_rising = defaultdict[str, list[bool]](list)
    is_even = defaultdict[str, list[bool]](list)
    for (scenario, estimator), rows in trials.groupby(["scenario", "estimator"]):
        per_unit = rows.pivot_table(index="unit", columns="severity", values="log_loss").dropna()
        if per_unit.empty:
            continue
        by_severity = per_unit.mean()
        correlation = _spearman(by_severity.index.to_numpy(), by_severity.to_numpy())
        per_step = np.exp(np.diff(by_severity.to_numpy()) / np.diff(by_severity.index.to_numpy()))
        share = float((per_unit[per_unit.columns.max()] > per_unit[per_unit.columns.min()]).mean())
        losses = ", ".join(f"{loss:.3g}" for loss in np.exp(by_severity))
        steps = ", ".join(f"{step:.2f}" for step in per_step)
        print(f"| {scenario} | {estimator} | {len(per_unit)} | {losses} | {correlation:.2f} | {share:.2f} | {steps} |")
        is_rising[str(scenario)].append(correlation >= RISING)
        is_even[str(scenario)].append(bool(((per_step >= STEP_RATIOS[0]) & (per_step <= STEP_RATIOS[1])).all()))
    rising = sum(any(each) for each in is_rising.values())
    even = sum(any(each) for each in is_even.values())
    print(f"\n{rising} of {len(is_rising)} scenarios rise for one of the estimators, {even} in even steps")


def _spearman(severities: NDArray[np.int64], losses: NDArray[np.float64]) -> float:
    """Spearman's correlation; 0 if all losses are equal."""
    if np.ptp(losses) == 0:
        return 0.0
    return float(spearmanr(severities, losses).statistic)


# --- Channels ---


def _print_channels(run: Path) -> None:
    """For each scenario, the topics that differ between severities in any unit, and those that never do."""
    print("| scenario | units | topics that change | topics that stay |")
    print("|---|---|---|---|")
    digests_of = defaultdict[tuple[str, str], list[dict[str, str]]](list)
    for scenario, unit, folder in _recordings(run):
        digests_of[scenario, unit].append(_digests(folder))
    scenarios = sorted({scenario for scenario, _ in digests_of})
    for scenario in scenarios:
        by_unit = [digests for (name, _), digests in digests_of.items() if name == scenario]
        topics = sorted(by_unit[0][0])
        changing = [topic for topic in topics if any(_differ(digests, topic) for digests in by_unit)]
        staying = [topic for topic in topics if topic not in changing]
        print(f"| {scenario} | {len(by_unit)} | {', '.join(changing)} | {', '.join(staying)} |")


def _recordings(run: Path) -> Iterator[tuple[str, str, Path]]:
    """The scenario, the unit and the folder of the recording of each case of a run."""
    folder = open_run(run)
    cases = pd.read_csv(run / "trials.csv").drop_duplicates("case")
    for case, scenario in zip(cases["case"], cases["scenario"], strict=True):
        yield scenario, _unit(case), folder.case(case) / SEQUENCE


def _digests(folder: Path) -> dict[str, str]:
    """The hash of all messages of each topic of a recording, with their stamps."""
    hashes: defaultdict[str, hashlib._Hash] = defaultdict(hashlib.sha256)
    for path in sorted(folder.glob("*.mcap")):
        with path.open("rb") as stream:
            for _, channel, message in make_reader(stream).iter_messages():
                hashes[channel.topic].update(f"{message.log_time} {len(message.data)}\n".encode())
                hashes[channel.topic].update(message.data)
    return {topic: digest.hexdigest() for topic, digest in hashes.items()}


def _differ(digests: list[dict[str, str]], topic: str) -> bool:
    """Whether the messages of a topic differ between recordings."""
    return len({digest.get(topic) for digest in digests}) > 1


if __name__ == "__main__":
    main()
