"""Every run tries the same examples, so that a test that failed fails again. Makers that tests write may run.

Many tests start processes with an empty cache. They share the machine code of compiled functions, since compiling takes
a second or more of each process. Each process computes in one thread, since there are as many processes as cores, and
threads that share a core spend much of their time on waiting for each other.
"""

import gc
import os
from pathlib import Path

import pytest
from hypothesis import settings

from vobench import trust

# Those of vobench.estimator.program, which cannot be imported here, since it loads numpy.
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM")
for _name in THREADS:
    os.environ.setdefault(_name, "1")  # before numpy and OpenCV are loaded
os.environ.setdefault("NUMBA_CACHE_DIR", str(Path(__file__).parents[1] / ".pytest_cache" / "kernels"))
gc.disable()  # it is enabled again after collection, during which it would find nothing
settings.register_profile("steady", derandomize=True, max_examples=40, deadline=None)
settings.load_profile("steady")


def pytest_xdist_auto_num_workers() -> int:
    """One process of tests more than there are cores, since some tests wait most of their time."""
    return (os.cpu_count() or 1) + 1


def pytest_collection_finish() -> None:
    """Start the garbage collector, but not on what was collected, since that lives to the end."""
    gc.freeze()
    gc.enable()


@pytest.fixture(scope="session", autouse=True)
def _own_makers(tmp_path_factory: pytest.TempPathFactory) -> None:
    """On a machine without a sandbox, the makers of scenes that tests write run as those of the user."""
    ours = (Path.cwd(), tmp_path_factory.getbasetemp())
    trust.adopt(trust.TrustPolicy(tuple(folder.resolve() for folder in ours)))


@pytest.fixture(autouse=True)
def _no_width(monkeypatch: pytest.MonkeyPatch) -> None:
    """Output that is not a terminal has its own width, not that of the terminal of whoever runs the tests."""
    monkeypatch.delenv("COLUMNS", raising=False)
