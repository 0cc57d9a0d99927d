"""A ray-plane test bed: a textured box room, filmed with exact calibration and exact poses."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from vobench.catalog.manifest import read_manifest
from vobench.estimator import Estimator, Frame, Result
from vobench.estimator.load import load
from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array

ESTIMATORS = Path(__file__).parents[2] / "estimators"
FRAME_RATE_HZ = 30
TEXEL_M = 0.001
ROOM_LOW_M, ROOM_HIGH_M = np.array([-1.5, -2.0, 0.0]), np.array([2.5, 2.0, 2.5])


@cache
def texture_levels(size: int = 4096, seed: int = 5) -> list[np.ndarray]:
    """A band-limited random texture (finest grain 4 texels) and its coarser levels, all float32."""
    rng = np.random.default_rng(seed)
    octaves = [rng.uniform(-1, 1, (size >> k, size >> k)).astype(np.float32) for k in range(2, 9)]
    texture = sum(cv2.resize(octave, (size, size), interpolation=cv2.INTER_CUBIC) for octave in octaves)
    levels = [np.clip(127.5 + 45 * texture, 0, 255).astype(np.float32)]
    for _ in range(5):
        levels.append(cv2.pyrDown(levels[-1], borderType=cv2.BORDER_REFLECT_101))
    return levels


def box_hit(origin: Array, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where rays (H, W, 3) from inside the room leave it: range (H, W) and wall axis (H, W)."""
    wall = np.where(rays > 0, ROOM_HIGH_M, ROOM_LOW_M) - origin
    reach = wall / np.where(np.abs(rays) < 1e-9, 1e-9, rays)
    return reach.min(-1), reach.argmin(-1)


def snapshot(lens: Pinhole, T_world_camera: Array) -> np.ndarray:
    """What a perfect camera sees of the room: (H, W) uint8.

    One ray a pixel is enough: the level of the texture is chosen so that nothing finer than
    two pixels is left in it.
    """
    rays = lens.rays(lens.pixel_grid()) @ T_world_camera[:3, :3].T
    origin = T_world_camera[:3, 3]
    reach, axis = box_hit(origin, rays)
    texel = (origin + reach[..., None] * rays - ROOM_LOW_M) / TEXEL_M
    texel_u = np.where(axis == 0, texel[..., 1], texel[..., 0])
    texel_v = np.where(axis == 2, texel[..., 1], texel[..., 2] + 1500 * axis)
    slant = np.abs(np.take_along_axis(rays, axis[..., None], -1)[..., 0])
    level = np.log2(reach / (lens.fx_px * TEXEL_M * np.sqrt(slant)))
    return np.round(sampled(texel_u, texel_v, np.clip(level, 0, 5))).astype(np.uint8)


def sampled(texel_u: np.ndarray, texel_v: np.ndarray, level: np.ndarray) -> np.ndarray:
    """The texture at fractional texels, linear in place and in level."""
    out = np.zeros(level.shape, np.float32)
    for k, texture in enumerate(texture_levels()):
        share = np.maximum(0, 1 - np.abs(level - k)).astype(np.float32)
        if share.any():
            u, v = (texel_u / 2**k).astype(np.float32), (texel_v / 2**k).astype(np.float32)
            out += share * cv2.remap(texture, u, v, cv2.INTER_LINEAR)
    return out


def film(rig: Rig, T_world_body: Array) -> list[Frame]:
    """One stereo frame for each pose (N, 4, 4) of the body."""
    return [
        Frame(
            index=k,
            t_ns=k * 10**9 // FRAME_RATE_HZ,
            left=snapshot(rig.left, T @ rig.T_body_left),
            right=snapshot(rig.right, T @ rig.T_body_right),
        )
        for k, T in enumerate(T_world_body)
    ]


def drive(*segments: tuple[int, float, float]) -> Array:
    """Body poses (N, 4, 4) of a robot on the floor: exact arcs of (frames, speed m/s, turn rate rad/s)."""
    T = [np.eye(4)]
    for frames, speed_mps, turn_radps in segments:
        half = turn_radps / FRAME_RATE_HZ / 2
        chord = speed_mps / FRAME_RATE_HZ * np.sinc(half / np.pi)
        step = se3.transform(se3.rotation_z(2 * half), [chord * np.cos(half), chord * np.sin(half), 0])
        for _ in range(frames):
            T.append(T[-1] @ step)
    return np.stack(T)


@dataclass(frozen=True, slots=True)
class Accuracy:
    """How far an estimate ends from the truth, with the first pose of both laid on each other."""

    end_m: float
    end_rad: float
    path_m: float

    @property
    def end_fraction(self) -> float:
        return self.end_m / self.path_m


def accuracy(results: Sequence[Result], T_world_frame: Array) -> Accuracy:
    truth = se3.inverse(T_world_frame[0]) @ T_world_frame
    error = se3.inverse(truth[-1]) @ results[-1].T_odom_frame
    path = np.linalg.norm(np.diff(truth[:, :3, 3], axis=0), axis=1).sum()
    return Accuracy(float(np.linalg.norm(error[:3, 3])), float(se3.rotation_angle(error[:3, :3])), float(path))


def started(name: str, rig: Rig, **params: object) -> Estimator:
    """The estimator of this name from the folder, started with its manifest's parameters."""
    manifest = read_manifest(ESTIMATORS / name)
    estimator = load(ESTIMATORS / name, manifest.class_path, name=name)
    estimator.start(rig, {**manifest.params, **params}, seed=0)
    return estimator


def estimated(name: str, rig: Rig, frames: Sequence[Frame], **params: object) -> list[Result]:
    estimator = started(name, rig, **params)
    return [estimator.process(frame) for frame in frames]


@dataclass(frozen=True, slots=True)
class Bed:
    """The test bed as one fixture."""

    film: Callable[..., list[Frame]] = film
    drive: Callable[..., Array] = drive
    accuracy: Callable[..., Accuracy] = accuracy
    started: Callable[..., Estimator] = started
    estimated: Callable[..., list[Result]] = estimated


@pytest.fixture(scope="session")
def bed() -> Bed:
    return Bed()
