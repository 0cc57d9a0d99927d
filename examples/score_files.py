"""Score one TUM trajectory against another from Python: python examples/score_files.py GT EST."""

import sys
from pathlib import Path

from vobench.metric.score import ScoreSettings, score
from vobench.trajectory.text import parse_tum


def main(gt_file: str, est_file: str) -> None:
    """Print the RMSE of every metric, and its identity."""
    gt, est = (parse_tum(Path(name).read_text(), name=name) for name in (gt_file, est_file))
    for metric in score(gt, est, settings=ScoreSettings(alignment="se3")).metrics:
        print(f"{metric.id} {metric.statistics.rmse:.6g} {metric.unit}")


if __name__ == "__main__":
    main(*sys.argv[1:])
