"""vobench: simulate, run and score visual odometry, and explain why it fails.

Python code can do everything that the command line does; see docs/python.md. Each name is imported when it is first
used.
"""

import sys
from importlib import import_module
from typing import TYPE_CHECKING

from vobench.portable import hold

hold()  # before anything imports numpy

if TYPE_CHECKING:
    from importlib.machinery import ModuleSpec

    from vobench.metric.settings import LIKE, ScoreSettings
    from vobench.notebook.class_source import write_estimator
    from vobench.notebook.makers import trust_maker
    from vobench.notebook.pictures import render
    from vobench.notebook.questions import causes, drive, explain, explain_recording, realism, shrink, twin
    from vobench.notebook.runs import Check, Run, bundle, check, compare, leaderboard, read_board, read_run, run
    from vobench.notebook.sequences import read_sequence
    from vobench.notebook.simulation import Simulation, simulate
    from vobench.notebook.trajectories import diagnose, read_trajectory, score
    from vobench.sequence import Sequence
    from vobench.trajectory.trajectory import Trajectory

__version__ = "0.1.0"

# Where each public name is defined.
_HOMES = {
    "LIKE": "vobench.metric.settings",
    "ScoreSettings": "vobench.metric.settings",
    "Sequence": "vobench.sequence",
    "Trajectory": "vobench.trajectory.trajectory",
    "causes": "vobench.notebook.questions",
    "drive": "vobench.notebook.questions",
    "explain": "vobench.notebook.questions",
    "explain_recording": "vobench.notebook.questions",
    "realism": "vobench.notebook.questions",
    "shrink": "vobench.notebook.questions",
    "twin": "vobench.notebook.questions",
    "Check": "vobench.notebook.runs",
    "Run": "vobench.notebook.runs",
    "bundle": "vobench.notebook.runs",
    "check": "vobench.notebook.runs",
    "compare": "vobench.notebook.runs",
    "leaderboard": "vobench.notebook.runs",
    "read_board": "vobench.notebook.runs",
    "read_run": "vobench.notebook.runs",
    "run": "vobench.notebook.runs",
    "trust_maker": "vobench.notebook.makers",
    "Simulation": "vobench.notebook.simulation",
    "read_sequence": "vobench.notebook.sequences",
    "render": "vobench.notebook.pictures",
    "simulate": "vobench.notebook.simulation",
    "diagnose": "vobench.notebook.trajectories",
    "read_trajectory": "vobench.notebook.trajectories",
    "score": "vobench.notebook.trajectories",
    "write_estimator": "vobench.notebook.class_source",
}
__all__ = [
    "LIKE",
    "Check",
    "Run",
    "ScoreSettings",
    "Sequence",
    "Simulation",
    "Trajectory",
    "__version__",
    "bundle",
    "causes",
    "check",
    "compare",
    "diagnose",
    "drive",
    "explain",
    "explain_recording",
    "leaderboard",
    "read_board",
    "read_run",
    "read_sequence",
    "read_trajectory",
    "realism",
    "render",
    "run",
    "score",
    "shrink",
    "simulate",
    "trust_maker",
    "twin",
    "write_estimator",
]

if not TYPE_CHECKING:  # otherwise a type checker would take every misspelt name for one of these

    def __getattr__(name):
        """Import a public name on first use."""
        if name not in _HOMES:
            raise AttributeError(f"module 'vobench' has no attribute {name!r}")
        value = getattr(import_module(_HOMES[name]), name)
        globals()[name] = value
        return value

    def __dir__():
        """The public names, imported or not."""
        return sorted(__all__)


class _Retired:
    """A finder of modules from earlier releases, used after all others, so that old plugins get a clear message."""

    @staticmethod
    def find_spec(name: str, _path: object = None, _target: object = None) -> "ModuleSpec | None":
        """The spec of a module in `vobench.retired`; None for any other name."""
        if not name.startswith("vobench."):
            return None
        from vobench import retired

        return retired.find_spec(name)


sys.meta_path.append(_Retired)
