"""The last renderer of a process, which the next sequence of the same scene in the same light uses again."""

from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vobench.rendering.renderer import Renderer


class LastRenderer:
    """Opens renderers, and keeps the last one open if `is_kept` is set; otherwise, each is closed after its use.

    To open the renderer of a park or a street takes as long as dozens of pictures. The operating system frees a
    renderer that is open when its process ends.
    """

    def __init__(self) -> None:
        self.is_kept = False
        self._key = ""
        self._renderer: Renderer | None = None

    @contextmanager
    def using(self, key: str, open_renderer: "Callable[[], Renderer]") -> "Iterator[Renderer]":
        """A renderer: the last one if it has the same key, or else a new one. It is closed after an exception."""
        if not self.is_kept:
            with closing(open_renderer()) as renderer:
                yield renderer
            return

        if self._renderer is None or self._key != key:
            self.close()
            self._renderer = open_renderer()
            self._key = key
        try:
            yield self._renderer
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Close the renderer that is kept, if there is one."""
        if self._renderer is not None:
            self._renderer.close()
        self._renderer = None
