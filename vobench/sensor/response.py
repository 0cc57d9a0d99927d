"""The curve from a chip's linear signal to the stored grey value: exact both ways, and fast over pictures. Pure."""

from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import TypeGuard

import numpy as np
from numpy.typing import NDArray

from vobench.errors import SettingError, unknown_name_sentence
from vobench.geometry.se3 import Array

Grey = NDArray[np.uint8]
FULL_SCALE_DN = 255
# Cells of the look-up table over the signal; a power of two, so that finding a signal's cell rounds nothing.
CELLS = 1 << 14
SHARED = FULL_SCALE_DN + 1  # marks a cell that two or more grey values share
# IEC 61966-2-1: below these values the curve of sRGB is a straight line.
SRGB_KNEE_LINEAR = 0.0031308
SRGB_KNEE_STORED = 0.04045


@dataclass(frozen=True, slots=True)
class Srgb:
    """The curve of sRGB (IEC 61966-2-1), which Blender's pictures have, and so the paper's."""

    def encode(self, linear: Array) -> Array:
        """Stored value in 0..1 of a linear signal in 0..1."""
        line = 12.92 * linear
        above_knee = np.maximum(linear, SRGB_KNEE_LINEAR)
        power: Array = 1.055 * above_knee ** (1 / 2.4) - 0.055
        return np.where(linear <= SRGB_KNEE_LINEAR, line, power)

    def decode(self, stored: Array) -> Array:
        """Linear signal in 0..1 of a stored value in 0..1."""
        line = stored / 12.92
        power = ((np.maximum(stored, SRGB_KNEE_STORED) + 0.055) / 1.055) ** 2.4
        return np.where(stored <= SRGB_KNEE_STORED, line, power)


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
class ResponseTable:
    """A measured curve: the linear signals of equally spaced stored values, interpolated linearly.

    256 of them are the inverse response of a photometric calibration; the last one is full scale, in any unit.
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
                order = f"value {index + 1} is {following} after {value}"
                raise SettingError(f"a tabulated response should rise, but {order}")

    def encode(self, linear: Array) -> Array:
        """Stored value in 0..1 of a linear signal in 0..1."""
        stored: Array = np.interp(linear, self._linear, self._stored)
        return stored

    def decode(self, stored: Array) -> Array:
        """Linear signal in 0..1 of a stored value in 0..1."""
        linear: Array = np.interp(stored, self._stored, self._linear)
        return linear

    @property
    def _linear(self) -> Array:
        """The linear signals of the knots, from 0 to 1."""
        return np.array(self.inverse) / self.inverse[-1]

    @property
    def _stored(self) -> Array:
        """The stored values of the knots, from 0 to 1."""
        return np.linspace(0, 1, len(self.inverse))


Response = Srgb | Power | ResponseTable
SRGB = Srgb()
LINEAR = Power(1.0)
RESPONSES: dict[str, Response] = {"linear": LINEAR, "srgb": SRGB}


def response_of(value: str | float | tuple[float, ...]) -> Response:
    """The response of a name, a gamma or a table. Raises SettingError."""
    if isinstance(value, str):
        if value not in RESPONSES:
            raise SettingError(unknown_name_sentence("response", value, list(RESPONSES)))
        return RESPONSES[value]
    if isinstance(value, list | tuple) and all(map(_is_number, value)):
        return ResponseTable(tuple(map(float, value)))
    if _is_number(value):
        return Power(float(value))
    raise SettingError(f"should be linear, srgb, a gamma such as 2.2 or a list of rising signals (got {value!r})")


def _is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, int | float) and not isinstance(value, bool)


def linear_of_grey(response: Response) -> Array:
    """Linear signals (256,) in 0..1 of all grey values: the inverse response of photometric calibrations."""
    stored = np.arange(FULL_SCALE_DN + 1) / FULL_SCALE_DN
    return response.decode(stored)


def quantise(linear: Array, response: Response) -> Grey:
    """Grey values of linear signals in 0..1: floor(255 · encode(linear) + 1/2), without evaluating the curve.

    A look-up table has the grey value of all signals in a cell. Signals in the few cells that contain a border between
    grey values are compared with the borders themselves.
    """
    cells = (linear * CELLS).astype(np.intp)
    grey = _cells(response).take(cells)
    shared = np.nonzero(grey == SHARED)
    grey[shared] = np.searchsorted(_borders(response), linear[shared], side="right")
    return grey.astype(np.uint8)


@cache
def _borders(response: Response) -> Array:
    """The signals (255,) at which grey values 1, 2, ... 255 begin."""
    stored = (np.arange(FULL_SCALE_DN) + 0.5) / FULL_SCALE_DN
    return response.decode(stored)


@cache
def _cells(response: Response) -> NDArray[np.uint16]:
    """The grey value (CELLS + 1,) of all signals in [i, i + 1) / CELLS, or SHARED where there are several."""
    edges = np.arange(CELLS + 2) / CELLS
    borders = _borders(response)
    first = np.searchsorted(borders, edges[:-1], side="right")
    last = np.searchsorted(borders, edges[1:], side="left")
    return np.where(first == last, first, SHARED).astype(np.uint16)
