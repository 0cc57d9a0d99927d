"""What may be left out of a mover's shade is left out, and nothing else."""

import numpy as np
import pytest

from vobench.render.direct_light import Rays
from vobench.render.emitter import Emitter, bulb_emitter, panel_emitter
from vobench.render.geometry import Ball, RayCaster
from vobench.render.lightmap import pack_atlas, texels
from vobench.render.mover_light import Target, may_shade, slices
from vobench.scene.light import PointLight
from vobench.scene.material import Matt
from vobench.scene.scene import ceiling_light
from vobench.scene.surface import box, rectangle

PILLAR = box(np.array([0.4, -0.2, 0.9]), (0.5, 0.3, 1.8), yaw_deg=25, material="grey")
FLOOR = rectangle(np.zeros(3), np.array([4.0, 0, 0]), np.array([0, 4.0, 0]), "grey")
MATERIALS = {"grey": Matt("plain", 0.5, 0.0, 1.0, 8, 0)}
LAMP = ceiling_light("panel", np.array([1.0, 0.3, 2.4]), (0.8, 0.4), power_lm=1000)
PANEL = panel_emitter(LAMP)
BULB = bulb_emitter(PointLight("bulb", np.array([-1.0, 0.5, 2.0]), 500.0))


def test_slices_enclose_all_of_a_thing_and_are_smaller_than_one_ball() -> None:
    u, v = np.random.default_rng(0).random((2, 200))
    points = np.concatenate([surface.at(u, v) for surface in PILLAR])
    balls = slices(PILLAR)
    assert np.any([np.linalg.norm(points - b.centre_m, axis=1) <= b.radius_m + 1e-9 for b in balls], axis=0).all()
    assert max(b.radius_m for b in balls) < 0.6
    assert len(slices([FLOOR])) == 1


@pytest.mark.parametrize("emitter", [PANEL, BULB], ids=["panel", "bulb"])
def test_a_place_from_which_a_ray_meets_the_thing_is_never_left_out(emitter: Emitter) -> None:
    numbers = np.random.default_rng(1)
    points = np.append(numbers.uniform(-4, 4, (4000, 2)), np.full((4000, 1), 1e-4), axis=1)
    lamp = LAMP.surface.at(*numbers.random((2, 4000))) if emitter is PANEL else emitter.ball.centre_m
    hidden = RayCaster(PILLAR, range(6)).occluded(points, np.broadcast_to(lamp, points.shape))
    kept = np.any([may_shade(b, emitter.ball, Ball(points, np.zeros(4000))) for b in slices(PILLAR)], axis=0)
    assert hidden.any()
    assert not (hidden & ~kept).any()
    assert kept.mean() < 0.6


@pytest.mark.parametrize("rays", [Rays(2), Rays(3, spread=True)])
def test_rays_that_serve_again_are_those_sent_anew(rays: Rays) -> None:
    atlas = pack_atlas([FLOOR], spacing_m=0.2)
    points = texels([FLOOR], MATERIALS, atlas, among=[0], seed=0)
    old, new = np.arange(10, 200), np.arange(120, 400, 3)
    walked = Target(PANEL)
    walked.sent(points, old, rays)
    again, fresh = walked.sent(points, new, rays), Target(PANEL).sent(points, new, rays)
    np.testing.assert_array_equal(again.some, new)
    for ours, theirs in ((again.start_m, fresh.start_m), (again.ahead_m, fresh.ahead_m), (again.light, fresh.light)):
        np.testing.assert_allclose(ours, theirs, rtol=1e-6)
    assert len(walked.sent(points, new[:0], rays).some) == 0
