"""vobench: simulate, run and score visual odometry, and explain where it breaks.

What a notebook needs is here and imported when it is first asked for; docs/python.md shows all of it.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from vobench.portable import hold

hold()  # before anything imports numpy

if TYPE_CHECKING:
    from vobench.metric.settings import LIKE, ScoreSettings
    from vobench.notebook import diagnose, read_board, read_sequence, read_trajectory, score
    from vobench.sequence import Sequence
    from vobench.trajectory.trajectory import Trajectory

__version__ = "0.1.0"
__all__ = [
    "LIKE",
    "ScoreSettings",
    "Sequence",
    "Trajectory",
    "__version__",
    "diagnose",
    "read_board",
    "read_sequence",
    "read_trajectory",
    "score",
]

if not TYPE_CHECKING:  # else every misspelt name would pass for one of ours
    _HOMES = {
        "LIKE": "metric.settings",
        "ScoreSettings": "metric.settings",
        "Sequence": "sequence",
        "Trajectory": "trajectory.trajectory",
    }

    def __getattr__(name):
        """A name of `__all__`, imported now."""
        if name not in __all__:
            raise AttributeError(f"module 'vobench' has no attribute {name!r}")
        return getattr(import_module(f"vobench.{_HOMES.get(name, 'notebook')}"), name)

    def __dir__():
        """What there is to complete, imported or not."""
        return sorted({*globals(), *__all__})
