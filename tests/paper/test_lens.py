"""The paper's camera: 32 mm, a sensor of 35 x 28.18 mm, 720 x 480 pixels."""

import pytest

from vobench.geometry.rig import LENSES


def test_the_papers_32_mm_lens_has_pixels_that_are_not_square_unless_blender_fits_the_width() -> None:
    literal, blender = LENSES["paper_literal"], LENSES["paper_blender"]
    assert (literal.fx_px, literal.fy_px) == (pytest.approx(658.3, abs=0.05), pytest.approx(545.1, abs=0.05))
    assert blender.fx_px == blender.fy_px == literal.fx_px
