"""What every stage works with: the store of finished results, and somebody to tell about progress."""

from dataclasses import dataclass

from vobench.pipeline.progress import Progress
from vobench.results.store import Store


@dataclass(frozen=True, slots=True)
class Workshop:
    """Where results are kept, and who hears of the work."""

    store: Store
    progress: Progress
