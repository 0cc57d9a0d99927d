"""What may be left out of a mover's shade is left out, and nothing else."""

import numpy as np
import pytest

from vobench.asset.shape import at, block
from vobench.geometry import se3
from vobench.render.emitter import Emitter, bulb_emitter, panel_emitter
from vobench.render.geometry import Ball, RayCaster
from vobench.render.mover_light import MovingCaster, may_shade, parts
from vobench.scene.light import PointLight
from vobench.scene.mesh import Thing, quad, table
from vobench.scene.scene import ceiling_light

PILLAR = block((0.5, 0.3, 1.8), bevel_m=0).moved(at(0.4, -0.2, 0.9, yaw=25))
FLOOR = quad((-2, -2, 0), (4, 0, 0), (0, 4, 0))
LAMP = ceiling_light("panel", np.array([1.0, 0.3, 2.4]), (0.8, 0.4), power_lm=1000)
PANEL = panel_emitter(LAMP)
BULB = bulb_emitter(PointLight("bulb", np.array([-1.0, 0.5, 2.0]), 500.0))
CASTER = RayCaster(table([Thing("pillar", PILLAR, "grey")], [-1], [-1]))


def each(balls: Ball) -> list[Ball]:
    return [balls.take(slice(nth, nth + 1)) for nth in range(len(balls.radius_m))]


def test_parts_enclose_all_of_a_thing_and_are_smaller_than_one_ball() -> None:
    weights = np.random.default_rng(0).dirichlet((1, 1, 1), 200)
    points = np.einsum("nk,fkj->fnj", weights, PILLAR.corners_m).reshape(-1, 3)
    balls = parts(PILLAR.corners_m)
    apart = np.linalg.norm(points[:, None] - balls.centre_m, axis=-1)
    assert (apart <= balls.radius_m + 1e-9).any(1).all()
    assert balls.radius_m.max() < 0.6
    assert len(parts(FLOOR.corners_m).radius_m) == 1


@pytest.mark.parametrize("emitter", [PANEL, BULB], ids=["panel", "bulb"])
def test_a_place_from_which_a_ray_meets_the_thing_is_never_left_out(emitter: Emitter) -> None:
    numbers = np.random.default_rng(1)
    points = np.append(numbers.uniform(-4, 4, (4000, 2)), np.full((4000, 1), 1e-4), axis=1)
    spots = np.einsum("nk,kj->nj", numbers.dirichlet((1, 1, 1), 4000), LAMP.mesh.corners_m[0])
    lamp = spots if emitter is PANEL else np.broadcast_to(emitter.ball.centre_m, points.shape)
    hidden = CASTER.occluded(points, lamp)
    kept = np.any([may_shade(b, emitter.ball, Ball(points, np.zeros(4000))) for b in each(parts(PILLAR.corners_m))], 0)
    assert hidden.any()
    assert not (hidden & ~kept).any()
    assert kept.mean() < 0.6


def test_rays_against_a_body_that_has_moved_are_those_against_it_at_rest() -> None:
    T_world_body = at(0.7, -0.4, 0.1, yaw=70)
    moved = RayCaster(table([Thing("pillar", PILLAR.moved(T_world_body), "grey")], [-1], [-1]))
    numbers = np.random.default_rng(2)
    origins, ways = numbers.uniform(-2, 2, (3000, 3)), numbers.uniform(-3, 3, (3000, 3))
    there, here = MovingCaster([(CASTER, se3.inverse(T_world_body))]), CASTER.stops(origins, ways)
    np.testing.assert_array_equal(there.stops(origins, ways), moved.stops(origins, ways))
    both = MovingCaster([(CASTER, se3.inverse(T_world_body))], CASTER)
    np.testing.assert_array_equal(both.stops(origins, ways), moved.stops(origins, ways) | here)
