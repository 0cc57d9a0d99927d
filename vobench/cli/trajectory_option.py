"""Arguments and options of commands that compare two trajectories."""

from pathlib import Path
from typing import Annotated

import typer

from vobench.cli.option import option_group
from vobench.runner.trajectory_pair import TrajectorySource

TruthPath = Annotated[
    Path, typer.Argument(metavar="GT", help="The ground truth: a file in any form, or the folder of a sequence.")
]
EstimatePath = Annotated[
    Path,
    typer.Argument(
        metavar="EST",
        help="The estimate: TUM, KITTI, TartanAir, EuRoC, MCAP or ROS bag, detected from content.",
    ),
]
Topic = Annotated[str | None, typer.Option(help="The topic of the poses, or /tf:parent.child.")]
CONVENTIONS_HELP = (
    "s|ms|us|ns, xyzw|wxyz, inverse, rotations:inverse, axes:z,-x,-y, positions:y,x,z or mount:x,y,z,qx,qy,qz,qw; "
    "can be repeated."
)
Conventions = Annotated[list[str] | None, typer.Option(help=CONVENTIONS_HELP)]


@option_group
class TrajectoryOptions:
    """How the files of ground truth and estimates are read."""

    gt_topic: Topic = None
    est_topic: Topic = None
    gt_as: Conventions = None
    est_as: Conventions = None
    times: Annotated[
        list[Path] | None,
        typer.Option(
            help="A file with stamps in seconds, one a line, for forms without stamps (KITTI); can be repeated, and "
            "each trajectory uses the file that fits."
        ),
    ] = None

    def truth(self, path: Path) -> TrajectorySource:
        """The ground truth in a file or a folder."""
        return TrajectorySource(path, self.gt_topic, tuple(self.gt_as or ()))

    def estimate(self, path: Path) -> TrajectorySource:
        """The estimate in a file."""
        return TrajectorySource(path, self.est_topic, tuple(self.est_as or ()))

    @property
    def time_files(self) -> list[Path]:
        """The files with stamps."""
        return self.times or []
