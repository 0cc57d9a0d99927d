"""A point of the world lands where the camera matrix and the recorded pose say, in both eyes, through every lens."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.rendering.rectangles import box, room
from vobench.asset.texture import Procedural
from vobench.geometry import se3
from vobench.geometry.camera import BrownConrady, Camera, DoubleSphere, Equirectangular, KannalaBrandt, Pinhole
from vobench.geometry.rig import LENSES, Rig, stereo_rig
from vobench.geometry.se3 import Array
from vobench.rendering.renderer import single_instant
from vobench.scene.material import Material
from vobench.scene.scene import Scene
from vobench.sensor.image_sensor import CameraSettings, NoiseStreams, expose
from vobench.sequence import Sequence, SequenceWriter, read_truth

pytestmark = pytest.mark.slow  # run by `pytest -m slow`, and by CI

POSES = ((0.0, 0.0, 17.0), (0.31, -0.47, 71.0), (-1.1, 0.83, 200.0), (0.5, 0.5, -40.0))  # x, y in m, heading in deg
EYES = ("left", "right")
every_lens = pytest.mark.parametrize("lens", LENSES.values(), ids=list(LENSES))
every_view = pytest.mark.parametrize("pitch_deg", [90, 55, 15], ids=["down", "slanted", "ahead"])


def body_poses() -> list[Array]:
    return [se3.transform(se3.rotation_z(np.deg2rad(heading)), (x, y, 0)) for x, y, heading in POSES]


def eyes(rig: Rig, T_world_body: Array) -> Iterator[tuple[Camera, Array]]:
    yield rig.left, T_world_body @ rig.T_body_left
    yield rig.right, T_world_body @ rig.T_body_right


@every_lens
@every_view
def test_the_corner_finder_finds_corners_where_they_should_be(
    hall: Any, measure: Any, corner_finder: Any, lens: Pinhole, pitch_deg: float
) -> None:
    errors = []
    for T_world_body in body_poses():
        for camera, T_world_camera in eyes(stereo_rig(lens, pitch_deg=pitch_deg), T_world_body):
            picture = hall.picture(camera, T_world_camera)
            uv = np.concatenate([pixels for _, pixels in hall.corners(camera, T_world_camera)])
            errors.append(corner_finder(picture, uv) - uv)
    measure.check(np.concatenate(errors), at_least=80)


@every_lens
@every_view
def test_pictures_lie_on_those_that_geometry_alone_predicts(
    hall: Any, measure: Any, lens: Pinhole, pitch_deg: float
) -> None:
    errors, half = [], 15
    for T_world_body in body_poses():
        for camera, T_world_camera in eyes(stereo_rig(lens, pitch_deg=pitch_deg), T_world_body):
            picture = hall.picture(camera, T_world_camera)
            for lattice, uv in hall.corners(camera, T_world_camera):
                for u, v in np.rint(uv).astype(int):
                    seen = picture[v - half : v + half + 1, u - half : u + half + 1]
                    exact = measure.exact_window(camera, T_world_camera, lattice, np.array([u, v]), half)
                    errors.append(measure.shift_px(seen, exact))
    measure.check(np.array(errors), at_least=80)


CURVED = {
    "brown_conrady": BrownConrady(752, 480, 458.7, 457.3, 367.2, 248.4, -0.283, 0.074, 0.0002, 0.00002),
    "kannala_brandt": KannalaBrandt(640, 480, 290.0, 288.0, 318.0, 243.0, -0.01, 0.005, -0.002, 0.0003),
    "double_sphere": DoubleSphere(600, 600, 210.0, 210.0, 300.0, 298.0, -0.2, 0.6),
    "equirectangular": Equirectangular(1440, 720),
}


@pytest.mark.parametrize("camera", CURVED.values(), ids=list(CURVED))
def test_through_a_curved_lens_pictures_lie_on_those_that_geometry_alone_predicts(
    hall: Any, measure: Any, camera: Camera
) -> None:
    errors, half = [], 15
    for T_world_body in body_poses()[:2]:
        for eye, T_world_camera in eyes(stereo_rig(camera, pitch_deg=40), T_world_body):
            picture = hall.picture(eye, T_world_camera)
            for lattice, uv in hall.corners(eye, T_world_camera, apart_px=28):
                for u, v in np.rint(uv[:: len(uv) // 16 + 1]).astype(int):
                    seen = picture[v - half : v + half + 1, u - half : u + half + 1]
                    exact = measure.exact_window(eye, T_world_camera, lattice, np.array([u, v]), half)
                    errors.append(measure.shift_px(seen, exact))
    measure.check(np.array(errors), at_least=50)


@every_lens
def test_corners_read_back_from_a_recording_are_where_its_truth_says(
    hall: Any, measure: Any, corner_finder: Any, tmp_path: Path, lens: Pinhole
) -> None:
    rig, errors = stereo_rig(lens, pitch_deg=55), []
    noise = NoiseStreams(*np.random.default_rng(0).spawn(2))
    with SequenceWriter(tmp_path, rig, case_json=b"{}") as writer:
        for index, T_world_body in enumerate(body_poses()):
            views = [hall.picture(*eye) for eye in eyes(rig, T_world_body)]
            left, right = (expose(view / np.float32(35.0), CameraSettings(), noise) for view in views)
            writer.write_frame(index * 100_000_000, left, right)
            writer.write_truth(index * 100_000_000, T_world_body, np.zeros(6))
    sequence, truth = Sequence.open(tmp_path), read_truth(tmp_path)
    for frame, T_world_body in zip(sequence.frames(), truth.T_world_frame, strict=True):
        for name, (camera, T_world_camera) in zip(EYES, eyes(sequence.rig, T_world_body), strict=True):
            uv = np.concatenate([pixels for _, pixels in hall.corners(camera, T_world_camera)])
            errors.append(corner_finder(getattr(frame, name), uv) - uv)
    measure.check(np.concatenate(errors), at_least=80)


BOX_CENTER_M, BOX_SIZE_M, BOX_YAW_DEG = np.array([2.6, -0.3, 0.6]), (0.8, 0.6, 1.2), 20.0
BRIGHT, DARK = 0.8, 0.2


def upright_edges(camera: Camera, T_world_camera: Array) -> list[Array]:
    """Pixels (M, 2) along the four upright edges of the box, from its foot up."""
    heights = np.linspace(-0.55, 0.55, 2001)
    R = se3.rotation_z(np.deg2rad(BOX_YAW_DEG))
    feet = [BOX_CENTER_M + R @ np.array([0.4 * x, 0.3 * y, 0]) for x in (-1, 1) for y in (-1, 1)]
    lines = [foot + heights[:, None] * [0, 0, 1] for foot in feet]
    return [camera.project(se3.apply(se3.inverse(T_world_camera), line)) for line in lines]


def edge_errors(picture: Array, edge: Array, *, inside: int, reach: int = 6) -> Array:
    """Per row, how far right of `edge` the border of the bright side lies, by the area that brightness covers."""
    order = np.argsort(edge[:, 1])
    rows = np.arange(int(max(edge[:, 1].min(), 0)) + 8, int(min(edge[:, 1].max(), len(picture) - 1)) - 8)
    exact = np.interp(rows, edge[order, 1], edge[order, 0])
    first = exact.astype(int) - reach
    bright = np.stack([picture[v, a : a + 2 * reach + 2] for v, a in zip(rows, first, strict=True)]) - DARK
    covered = bright.sum(1) / (BRIGHT - DARK)
    border = first - 0.5 + covered if inside < 0 else first + 2 * reach + 1.5 - covered
    return border - exact


@every_lens
@pytest.mark.parametrize("heading_deg", [0, -13])
def test_the_outline_of_a_box_lies_where_its_edges_project(
    even_light: Any, draw: Any, measure: Any, lens: Pinhole, heading_deg: float
) -> None:
    materials = {
        name: Material(texture=Procedural("plain", a, 0, 1, 8, 0)) for name, a in (("bright", BRIGHT), ("dark", DARK))
    }
    furniture = box(BOX_CENTER_M, BOX_SIZE_M, yaw_deg=BOX_YAW_DEG, material="bright")
    surfaces = (*room((8, 8, 3), floor="dark", wall="dark", ceiling="dark"), *furniture)
    renderer = draw(even_light(Scene("box", surfaces, materials, ()), illuminance_lx=np.pi))
    T_world_body = se3.transform(se3.rotation_z(np.deg2rad(heading_deg)), (0, 0.1, 0))
    for camera, T_world_camera in eyes(stereo_rig(lens, pitch_deg=15), T_world_body):
        picture = renderer.radiance(camera, single_instant(camera, T_world_camera))
        edges = sorted(upright_edges(camera, T_world_camera), key=lambda edge: float(edge[:, 0].mean()))
        for edge, inside in ((edges[0], 1), (edges[-1], -1)):
            errors = edge_errors(picture, edge, inside=inside)
            assert len(errors) > 100
            assert abs(errors.mean()) < measure.LIMIT_PX
            # Four columns of samples a pixel place each single row of a leaning edge to a sixth of a pixel.
            assert np.abs(errors).max() < 0.18
