"""Confidence intervals of a change where nothing is random: a bootstrap over blocks of segments of the path."""

import numpy as np

from vobench.geometry.se3 import Array

RESAMPLES = 2000
BLOCK_SEGMENTS = 3  # neighbouring segments are not independent, so blocks of them are resampled
INTERVAL_PERCENT = (2.5, 97.5)
MIN_MEAN_LOSS = 1e-12


def block_interval(loss_before: Array, loss_after: Array) -> tuple[float, float]:
    """The 95 % interval of the decrease of the mean error of segments (S,), which both trials share.

    Source: Künsch (1989), "The jackknife and the bootstrap for general stationary observations", the block bootstrap.
    """
    block_count = -(-len(loss_before) // BLOCK_SEGMENTS)
    starts = np.random.default_rng(0).random((RESAMPLES, block_count))  # as shares of the trial
    means_before = np.maximum(block_means(loss_before, starts), MIN_MEAN_LOSS)
    means_after = np.maximum(block_means(loss_after, starts), MIN_MEAN_LOSS)
    low, high = np.percentile(1 - means_after / means_before, INTERVAL_PERCENT).tolist()
    return low, high


def block_means(loss: Array, starts: Array) -> Array:
    """The means (R,) of resampled errors of segments (S,), of blocks that begin at shares (R, B) of the trial."""
    segments = len(loss)
    first = (starts * segments).astype(int)
    block_rows = first[..., None] + np.arange(BLOCK_SEGMENTS)  # (R, B, BLOCK_SEGMENTS)
    rows = block_rows.reshape(len(starts), -1)[:, :segments]
    means: Array = loss[rows % segments].mean(1)  # blocks at the end go on at the start
    return means
