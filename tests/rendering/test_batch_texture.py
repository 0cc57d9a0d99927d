"""Textures are halved until all of them fit into graphics memory."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

batch_texture = pytest.importorskip("vobench.rendering.batch_texture")


@given(st.lists(st.integers(1, 4 * batch_texture.MOST_TEXELS), max_size=6))
def test_textures_are_halved_until_they_fit_and_no_further(counts):
    texel_counts = np.array(counts, float)
    halvings = batch_texture.halvings(texel_counts)
    reduced_counts = texel_counts / 4.0**halvings
    assert reduced_counts.sum() <= batch_texture.MOST_TEXELS
    if halvings.any():
        # Each halved texture was the largest one before its last halving.
        before_last = 4 * reduced_counts[halvings > 0]
        assert before_last.min() >= reduced_counts.max()


def test_textures_that_fit_keep_their_resolution():
    assert batch_texture.halvings(np.array([batch_texture.MOST_TEXELS], float)).tolist() == [0]
    assert batch_texture.halvings(np.array([batch_texture.MOST_TEXELS, 1.0])).tolist() == [1, 0]
