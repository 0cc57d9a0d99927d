"""The pixels of painted textures: a process keeps those that it needed last, and paints others again."""

from collections import OrderedDict
from collections.abc import Callable
from typing import Any

from numpy.typing import NDArray

MIB = 1 << 20
PLACE_MIB = 60  # about what the textures of a furnished flat take
KEPT_BYTES = 6 * PLACE_MIB * MIB

Pixels = NDArray[Any]


class KeptPixels:
    """Pixels that were needed last, up to a number of bytes. Those of one picture are kept whatever their size.

    Without a limit, a process that goes from place to place would keep the textures of all of them.
    """

    def __init__(self, most_bytes: int) -> None:
        self._most_bytes = most_bytes
        self._kept: OrderedDict[object, Pixels] = OrderedDict()  # those that were needed last are at the end
        self._bytes = 0

    def lazy(self, paint: Callable[[], Pixels]) -> Callable[[], Pixels]:
        """A function that returns the pixels of a picture, and paints them if they are not kept."""
        key = object()

        def pixels() -> Pixels:
            if key in self._kept:
                self._kept.move_to_end(key)
            else:
                self._keep(key, paint())
            return self._kept[key]

        return pixels

    def _keep(self, key: object, pixels: Pixels) -> None:
        """Keep new pixels, and forget those that were not needed for longest."""
        self._kept[key] = pixels
        self._bytes += pixels.nbytes
        while self._bytes > self._most_bytes and len(self._kept) > 1:
            _, forgotten = self._kept.popitem(last=False)
            self._bytes -= forgotten.nbytes


KEPT = KeptPixels(KEPT_BYTES)
