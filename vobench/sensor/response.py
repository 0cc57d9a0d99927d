"""The curve from a chip's linear signal to the stored grey value: exact both ways, and fast over pictures. Pure."""

from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from vobench.errors import SettingError, unknown
from vobench.geometry.se3 import Array

Grey = NDArray[np.uint8]
FULL_SCALE_DN = 255
# Cells of the look-up table over the signal; a power of two, so that finding a signal's cell rounds nothing.
CELLS = 1 << 14
TORN = FULL_SCALE_DN + 1  # marks a cell that two or more grey values share


@dataclass(frozen=True, slots=True)
class Srgb:
    """IEC 61966-2-1, two pieces that meet at 0.0031308; pictures made by Blender, as the paper's were, carry it."""

    def encode(self, linear: Array) -> Array:
        """Stored value in 0..1 of a linear signal in 0..1."""
        power: Array = 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055
        return np.where(linear <= 0.0031308, 12.92 * linear, power)

    def decode(self, stored: Array) -> Array:
        """Linear signal in 0..1 of a stored value in 0..1."""
        return np.where(stored <= 0.04045, stored / 12.92, ((np.maximum(stored, 0.04045) + 0.055) / 1.055) ** 2.4)


@dataclass(frozen=True, slots=True)
class Power:
    """stored = linear^(1 / gamma)."""

    gamma: float

    def __post_init__(self) -> None:
        if not 0.1 <= self.gamma <= 10:
            raise SettingError(f"the gamma of a response should be within 0.1 and 10, got {self.gamma}")

    def encode(self, linear: Array) -> Array:
        """Stored value in 0..1 of a linear signal in 0..1."""
        stored: Array = linear ** (1 / self.gamma)
        return stored

    def decode(self, stored: Array) -> Array:
        """Linear signal in 0..1 of a stored value in 0..1."""
        linear: Array = stored**self.gamma
        return linear


@dataclass(frozen=True, slots=True)
class Table:
    """A measured curve: the linear signals of equally spaced stored values, straight lines between.

    256 of them are the inverse response of a photometric calibration; the scale is free, the last is full scale.
    Source: Engel, Usenko and Cremers (2016), TUM monoVO, pcalib.txt.
    """

    inverse: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.inverse) < 2:
            raise SettingError(f"a tabulated response needs 2 or more values, got {len(self.inverse)}")
        if self.inverse[0] != 0:
            raise SettingError(f"a tabulated response should begin with 0, the signal of black, got {self.inverse[0]}")
        for index, (value, following) in enumerate(pairwise(self.inverse)):
            if not value < following < np.inf:
                raise SettingError(
                    f"a tabulated response should rise, but value {index + 1} is {following} after {value}"
                )

    def encode(self, linear: Array) -> Array:
        """Stored value in 0..1 of a linear signal in 0..1."""
        stored: Array = np.interp(linear, *self._knots)
        return stored

    def decode(self, stored: Array) -> Array:
        """Linear signal in 0..1 of a stored value in 0..1."""
        linear: Array = np.interp(stored, *self._knots[::-1])
        return linear

    @property
    def _knots(self) -> tuple[Array, Array]:
        return np.array(self.inverse) / self.inverse[-1], np.linspace(0, 1, len(self.inverse))


Response = Srgb | Power | Table
SRGB = Srgb()
LINEAR = Power(1.0)
RESPONSES: dict[str, Response] = {"linear": LINEAR, "srgb": SRGB}


def response_of(said: str | float | tuple[float, ...]) -> Response:
    """The response of a name, a gamma or a table. Raises SettingError."""
    if isinstance(said, str):
        if said not in RESPONSES:
            raise SettingError(unknown("response", said, list(RESPONSES)))
        return RESPONSES[said]
    numbers = said if isinstance(said, list | tuple) else [said]
    if not all(isinstance(number, int | float) and not isinstance(number, bool) for number in numbers):
        raise SettingError(f"should be linear, srgb, a gamma such as 2.2 or a list of rising signals (got {said!r})")
    return Table(tuple(map(float, said))) if isinstance(said, list | tuple) else Power(float(said))


def linear_of_grey(response: Response) -> Array:
    """Linear signals (256,) in 0..1 of all grey values: the inverse response, as photometric calibrations list it."""
    return response.decode(np.arange(FULL_SCALE_DN + 1) / FULL_SCALE_DN)


def quantise(linear: Array, response: Response) -> Grey:
    """Grey values of linear signals in 0..1: floor(255 · encode(linear) + 1/2), without evaluating the curve.

    A table knows the grey value of all signals in a cell; in the few cells that hold a border, signals are
    compared with the borders themselves.
    """
    borders = _borders(response)
    table = _cells(response)
    looked_up = table.take((linear * CELLS).astype(np.intp))
    torn = np.nonzero(looked_up == TORN)
    looked_up[torn] = np.searchsorted(borders, linear[torn], side="right")
    return looked_up.astype(np.uint8)


@cache
def _borders(response: Response) -> Array:
    """The signals (255,) at which grey values 1, 2, ... 255 begin."""
    return response.decode((np.arange(FULL_SCALE_DN) + 0.5) / FULL_SCALE_DN)


@cache
def _cells(response: Response) -> NDArray[np.uint16]:
    """The grey value (CELLS + 1,) of all signals in [i, i + 1) / CELLS, or TORN where there are several."""
    edges = np.arange(CELLS + 2) / CELLS
    borders = _borders(response)
    first = np.searchsorted(borders, edges[:-1], side="right")
    last = np.searchsorted(borders, edges[1:], side="left")
    return np.where(first == last, first, TORN).astype(np.uint16)
