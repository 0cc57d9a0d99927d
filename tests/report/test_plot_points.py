"""As many points as a plot can show, and no peak lost."""

import numpy as np

from vobench.report.plot_points import MOST_POINTS, path_points, peak_indices


def test_the_details_of_a_hundred_cells_of_a_thousand_frames_are_small():
    """Each curve and each path has no more points than a plot can show."""
    errors = np.abs(np.random.default_rng(0).normal(size=5000))
    assert len(peak_indices(errors)) <= MOST_POINTS >= len(path_points(errors[:, None].repeat(2, 1)))
    assert np.argmax(errors) in peak_indices(errors)
