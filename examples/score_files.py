"""Score one trajectory's file against another from Python: python examples/score_files.py GT EST."""

import sys

from vobench import ScoreSettings, score


def main(gt_file: str, est_file: str) -> None:
    """Print the RMSE of every metric, and its identity."""
    for metric in score(gt_file, est_file, settings=ScoreSettings(alignment="se3")).metrics:
        print(f"{metric.id} {metric.statistics.rmse:.6g} {metric.unit}")


if __name__ == "__main__":
    main(*sys.argv[1:])
