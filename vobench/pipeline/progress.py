"""How long work tells that it goes on; silent unless somebody listens."""

from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, nullcontext
from typing import Protocol, TypeVar

Item = TypeVar("Item")


class Progress(Protocol):
    """Receives news of the work, for a bar on a terminal or for nobody."""

    def track(self, items: Iterable[Item], what: str, *, total: int) -> Iterator[Item]:
        """The same items; `total` of them are expected."""

    def step(self, what: str) -> AbstractContextManager[Callable[[float], object]]:
        """Work of unknown length, which may tell what share of it is done."""


class Silent:
    """Nobody listens."""

    def track(self, items: Iterable[Item], what: str, *, total: int) -> Iterator[Item]:
        """The same items."""
        del what, total
        return iter(items)

    def step(self, what: str) -> AbstractContextManager[Callable[[float], object]]:
        """Nothing around the work."""
        del what
        return nullcontext(lambda _: None)
