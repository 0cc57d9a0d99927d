"""The stereo estimator in docs/estimators.md is what a reader copies: it must work as it stands."""

import numpy as np

from tests.estimators.conftest import ESTIMATORS
from vobench.estimator import Frame, Status
from vobench.estimator.worker import load
from vobench.geometry.rig import paper_lens, stereo_rig
from vobench.suite.manifest import read_manifest

RIG = stereo_rig(paper_lens(square_pixels=True), pitch_deg=10)


def example(folder):
    """The estimator of the page, written to a folder and started."""
    page = (ESTIMATORS.parent / "docs" / "estimators.md").read_text(encoding="utf-8")
    manifest, code = (page.split(f"```{language}\n")[1].split("```")[0] for language in ("yaml", "python"))
    (folder / "estimator.yaml").write_text(manifest)
    (folder / "estimator.py").write_text(code)
    described = read_manifest(folder)
    estimator = load(folder, described.class_path, name=described.name)
    estimator.start(RIG, described.params, seed=0)
    return estimator


def test_it_follows_a_curve_to_a_hundredth_of_the_path(bed, tmp_path):
    T_world_body = bed.drive((5, 0.5, 1.0))
    estimator = example(tmp_path)
    results = [estimator.process(frame) for frame in bed.film(RIG, T_world_body)]
    accuracy = bed.accuracy(results, T_world_body @ RIG.T_body_left)
    assert accuracy.end_fraction < 0.01
    assert accuracy.end_rad < np.deg2rad(0.1)
    assert results[-1].tracks.inlier.sum() > 100


def test_without_texture_it_is_lost(bed, tmp_path):
    estimator = example(tmp_path)
    grey = np.full((RIG.left.height_px, RIG.left.width_px), 90, np.uint8)
    estimator.process(Frame(0, 0, grey, grey))
    assert estimator.process(Frame(1, 10**8, grey, grey)).status is Status.LOST
