"""The positions of the samples in a pixel, by which edges are antialiased."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class SamplePattern:
    """The position (x, y) of each sample in a pixel, from 0 to 1, and the bias of its mipmap level (`lod_bias`)."""

    positions: tuple[tuple[float, float], ...]
    lod_bias: tuple[float, ...]


# Rotated-grid supersampling: no two samples share a row or a column, so that the position of an edge along either errs
# by at most an eighth of a pixel. Each sample reads one mipmap level. The levels differ, so that their mean is a blend.
ROTATED_GRID = SamplePattern(
    positions=((0.375, 0.125), (0.875, 0.375), (0.125, 0.625), (0.625, 0.875)),
    lod_bias=(-2.875, -2.375, -2.625, -2.125),
)


def _subset(first: int, second: int) -> SamplePattern:
    """Two samples of the rotated grid."""
    return SamplePattern(
        positions=(ROTATED_GRID.positions[first], ROTATED_GRID.positions[second]),
        lod_bias=(ROTATED_GRID.lod_bias[first], ROTATED_GRID.lod_bias[second]),
    )


# The rotated grid in two halves, each symmetric about the centre of the pixel. Sub-frames alternate between them.
OUTER_HALF = _subset(0, 3)
INNER_HALF = _subset(1, 2)
HALVES = (OUTER_HALF, INNER_HALF)


FINE_BITS = 4
FINE_SAMPLES = 2**FINE_BITS
FINE_PASSES = FINE_SAMPLES // len(ROTATED_GRID.positions)


def _fine_pattern(index: int) -> SamplePattern:
    """One of the patterns that together have 16 samples, each alone in its sixteenth of the width and height.

    Source: Hammersley (1960); the number of a sample, with its bits reversed, is its row.
    """
    columns = range(index, FINE_SAMPLES, FINE_PASSES)
    positions = [((column + 0.5) / FINE_SAMPLES, (_reversed_bits(column) + 0.5) / FINE_SAMPLES) for column in columns]
    return SamplePattern(tuple(positions), ROTATED_GRID.lod_bias)


def _reversed_bits(number: int) -> int:
    """A number below FINE_SAMPLES with its bits in reverse order."""
    return int(f"{number:0{FINE_BITS}b}"[::-1], 2)


FINE_GRID = tuple(_fine_pattern(index) for index in range(FINE_PASSES))

# For pictures that are drawn at twice the resolution in both directions.
PIXEL_CENTRE = SamplePattern(positions=((0.5, 0.5),), lod_bias=(-1.5,))
