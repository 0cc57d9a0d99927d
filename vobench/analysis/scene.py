"""What a scene holds and where a body can drive in it: figures, a plan, and views all around."""

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import looking
from vobench.rendering.geometry import RayCaster
from vobench.rendering.renderer import Renderer, still
from vobench.scene.light import Sky, Sun
from vobench.scene.material import Texture, reflectance, srgb
from vobench.scene.mesh import Triangles, distinct, open_edges, unit, welded
from vobench.scene.scene import Scene, triangles
from vobench.suite.free_way import Free, down, free_circle

EYE_M = 1.2
LOOKS = 4096


@dataclass(frozen=True, slots=True)
class SceneSurvey:
    """What is in a scene at the start.

    open_edges: of one face alone, of all things but flat ones; twins: faces with the corners of another; backs: the
    share of looks around, from the free circle or else from the middle of all, that meet the back of a face, which is
    not drawn, before any front; free is None where no floor is found.
    """

    things: int
    faces: int
    materials: int
    textures_mb: float
    low_m: tuple[float, float, float]
    high_m: tuple[float, float, float]
    lights: tuple[str, ...]
    open_edges: int
    twins: int
    backs: float
    free: Free | None


def survey(scene: Scene) -> SceneSurvey:
    """Look a scene over; no light is computed."""
    faces = triangles(scene, t_ns=0)
    caster = RayCaster(faces)
    corners = faces.corners_m.reshape(-1, 3)
    point = _points(faces)
    free = free_circle(faces, caster)
    middle_m = (corners.min(0) + corners.max(0)) / 2
    eye_m = [free.x_m, free.y_m, free.floor_m + EYE_M] if free else middle_m.tolist()
    textures: set[Texture] = {
        t for m in scene.materials.values() for t in (m.texture, m.emission_texture) if t is not None
    }
    low, high = (tuple(round(float(x), 3) for x in bound) for bound in (corners.min(0), corners.max(0)))
    return SceneSurvey(
        len({thing.name for thing in faces.things}),
        len(faces),
        len(scene.materials),
        sum(t.pixels().nbytes for t in textures) / 1e6,
        (low[0], low[1], low[2]),
        (high[0], high[1], high[2]),
        tuple(light.name for light in scene.lights),
        _open_edges(faces, point),
        len(point) - len(distinct(np.sort(point, axis=1))[0]),
        _backs(faces, caster, eye_m),
        free,
    )


def _open_edges(faces: Triangles, point: NDArray[np.intp]) -> int:
    """Edges that one face of a thing has alone; rectangles, which are nothing but open, do not count."""
    solid = np.isin(faces.thing, np.flatnonzero(np.bincount(faces.thing, minlength=len(faces.things)) > 2))
    point_of_thing = point[solid] + faces.thing[solid, None] * (point.max(initial=0) + 1)
    return len(open_edges(point_of_thing))


def _points(faces: Triangles) -> NDArray[np.intp]:
    """Which point (F, 3) each corner is; nearer than WELD_M they are one."""
    return welded(faces.corners_m.reshape(-1, 3))[1].reshape(-1, 3)


def _backs(faces: Triangles, caster: RayCaster, eye_m: ArrayLike) -> float:
    ways = unit(np.random.default_rng(0).standard_normal((LOOKS, 3)))
    hits = caster.hits(np.tile(eye_m, (LOOKS, 1)), ways)
    facing = np.einsum("ij,ij->i", faces.plane[hits.face], ways)
    return float(((hits.face >= 0) & (facing > 0)).mean())


Rgb8 = NDArray[np.uint8]
CELL_PX = (480, 320)
LENS = Pinhole(*CELL_PX, 240.0, 240.0, 239.5, 159.5)


def sheet(scene: Scene, found: SceneSurvey, renderer: Renderer, white_cd_m2: float, lines: Sequence[str]) -> Rgb8:
    """A picture (640, 1440, 3): the plan, some lines of text, and views to four sides from the free circle."""
    free = found.free or Free(0.0, 0.0, found.low_m[2], 0.0)
    views = [_view(renderer, free, yaw_deg, white_cd_m2) for yaw_deg in (45, 135, 225, 315)]
    cells = [_plan(scene, found), views[0], views[1], _written(lines), views[2], views[3]]
    return np.vstack([np.hstack(cells[:3]), np.hstack(cells[3:])])


def _view(renderer: Renderer, free: Free, yaw_deg: float, white_cd_m2: float) -> Rgb8:
    T = se3.transform(se3.rotation_z(np.deg2rad(yaw_deg)), [free.x_m, free.y_m, free.floor_m + EYE_M])
    pose = T @ looking(pitch_deg=8, position_m=(0, 0, 0))
    return srgb(renderer.radiance(LENS, still(LENS, pose), weights=None) / (1.5 * white_cd_m2))


def _plan(scene: Scene, found: SceneSurvey) -> Rgb8:
    """What is seen from above below a height at which rooms are open; the free circle drawn in."""
    faces = triangles(scene, t_ns=0)
    (width, height) = CELL_PX
    low = np.array(found.low_m[:2])
    high = np.array(found.high_m[:2])
    scale = min(width, height) / max((high - low).max(), 1e-6) * 0.96
    middle = (low + high) / 2
    px = np.stack(np.meshgrid(np.arange(width), np.arange(height)), -1).reshape(-1, 2) + 0.5
    places = (px - [width / 2, height / 2]) / scale * [1, -1] + middle
    floor_m = found.free.floor_m if found.free else found.low_m[2]
    hits = RayCaster(faces).hits(np.column_stack([places, np.full(len(places), floor_m + 2.0)]), down(len(places)))
    tones = {name: reflectance(material).mean() for name, material in scene.materials.items()}
    own = np.array([*(tones.get(thing.material, 0.9) for thing in faces.things), 1.0])
    thing = np.where(hits.face < 0, len(own) - 1, faces.thing[hits.face])
    lit = np.where(hits.face < 0, 1.0, 0.35 + 0.65 * np.abs(faces.plane[hits.face, 2]))
    plan = srgb((own[thing] * lit)[:, None].repeat(3, 1).astype(np.float32)).reshape(height, width, 3).copy()
    if found.free:
        at = (np.array([found.free.x_m, found.free.y_m]) - middle) * [1, -1] * scale + [width / 2, height / 2]
        radius_px = round(found.free.radius_m * scale)
        cv2.circle(plan, np.rint(at).astype(int).tolist(), radius_px, (20, 140, 60), 2, cv2.LINE_AA)
    return plan


def _written(lines: Sequence[str]) -> Rgb8:
    page = np.full((CELL_PX[1], CELL_PX[0], 3), 255, np.uint8)
    for row, line in enumerate(lines):
        cv2.putText(page, line, (16, 30 + 22 * row), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (30, 30, 30), 1, cv2.LINE_AA)
    return page


def strength(scene: Scene, name: str) -> str:
    """How strong a light is, in its unit."""
    light = next(light for light in scene.lights if light.name == name)
    return f"{light.illuminance_lx:.0f} lx" if isinstance(light, Sun | Sky) else f"{light.power_lm:.0f} lm"
