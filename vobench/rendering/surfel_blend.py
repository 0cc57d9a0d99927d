"""The weights by which the indirect light of surfels is interpolated on the light map."""

from typing import TYPE_CHECKING

import numpy as np
import scipy

from vobench.rendering.array_types import Floats, Mask, Rows
from vobench.rendering.blend_kernels import NORMAL_WEIGHT, Blending, count_weights, write_weights
from vobench.rendering.surfel import RAISED, Surfels
from vobench.rendering.texel import Texels
from vobench.rendering.texel_layout import TexelLayout
from vobench.rendering.thread_pool import chunked, in_chunks
from vobench.rendering.visibility import Visibility

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

NEIGHBOURS = 9  # the largest number of surfels between which the light of a texel is interpolated


def blend(
    points: Texels,
    groups: Surfels,
    layout: TexelLayout,
    visibility: Visibility,
    usable: Mask,
) -> "csr_matrix":
    """The weights (H·W, S) of surfels at each texel of the map.

    Surfels have a weight if they are near the surfel of the texel, have a similar normal, are not hidden from it, and
    are `usable` (S,).
    """
    usable_surfels = np.flatnonzero(usable)
    if not len(usable_surfels):
        return scipy.sparse.csr_matrix((layout.source.size, len(groups)), dtype=np.float32)
    middles = points.take(groups.middle)
    neighbours = _neighbours(middles, groups.step_m, usable_surfels)
    blending = Blending(
        points_m=points.points_m,
        point_normals=points.normals,
        surfel_of_point=groups.of,
        neighbours=neighbours,
        is_hidden=_are_hidden(middles, groups.step_m, neighbours, visibility),
        middles_m=middles.points_m,
        normals=middles.normals,
        step_m=groups.step_m,
    )
    return _weights(blending, layout)


def _neighbours(middles: Texels, step_m: Floats, usable_surfels: Rows) -> Rows:
    """The usable surfels (S, K) that are nearest to each surfel, in position and direction."""
    places = np.hstack([middles.points_m, NORMAL_WEIGHT * step_m[:, None] * middles.normals])  # (S, 6)
    tree = scipy.spatial.cKDTree(places[usable_surfels])
    _, nearest = tree.query(places, k=min(NEIGHBOURS, len(usable_surfels)))
    return np.sort(usable_surfels[nearest.reshape(len(middles), -1)], axis=1)


def _are_hidden(middles: Texels, step_m: Floats, neighbours: Rows, visibility: Visibility) -> Mask:
    """Whether each neighbour (S, K) is hidden from its surfel. If all are hidden, none counts as hidden."""
    raised_m = middles.points_m + RAISED * step_m[:, None] * middles.planes
    surfel = np.repeat(np.arange(len(middles)), neighbours.shape[1])

    def hidden(part: slice) -> Mask:
        return visibility.opaque.occluded(raised_m[surfel[part]], middles.points_m[neighbours.ravel()[part]])

    is_hidden = chunked(hidden, len(surfel)).reshape(neighbours.shape)
    is_hidden = is_hidden & (neighbours != np.arange(len(middles))[:, None])
    is_hidden &= ~is_hidden.all(1, keepdims=True)
    return np.asarray(is_hidden)


def _weights(blending: Blending, layout: TexelLayout) -> "csr_matrix":
    """The weights (H·W, S) of surfels at the texels of a map."""
    texel_count = layout.source.size
    starts = np.zeros(texel_count + 1, np.int32)  # where the entries of each texel begin
    in_chunks(lambda part: count_weights(layout.source[part], blending, starts[1:][part]), texel_count)
    np.cumsum(starts, out=starts)
    columns = np.empty(starts[-1], np.int32)
    values = np.empty(starts[-1], np.float32)

    def write(part: slice) -> None:
        entries = slice(starts[part.start], starts[part.stop])
        write_weights(layout.source[part], blending, columns[entries], values[entries])

    in_chunks(write, texel_count)
    return scipy.sparse.csr_matrix((values, columns, starts), (texel_count, len(blending.step_m)))
