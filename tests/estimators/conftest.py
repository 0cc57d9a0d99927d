"""A ray-plane test bed: a textured box room, filmed with exact calibration and exact poses."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest

from vobench.estimator import Estimator, Frame, Result
from vobench.estimator.worker import load
from vobench.geometry import se3
from vobench.geometry.camera import Camera, pixel_grid
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array
from vobench.suite.manifest import read_manifest

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
    """Where rays (3, H, W) from inside the room leave it: range (H, W) and wall axis (H, W)."""
    ways = zip(rays, np.float32(ROOM_LOW_M - origin), np.float32(ROOM_HIGH_M - origin), strict=True)
    x, y, z = (np.where(ray > 0, high, low) / np.where(np.abs(ray) < 1e-9, 1e-9, ray) for ray, low, high in ways)
    return np.minimum(np.minimum(x, y), z), np.where(z < np.minimum(x, y), 2, y < x)


def snapshot(lens: Camera, T_world_camera: Array) -> np.ndarray:
    """What a perfect camera sees of the room: (H, W) uint8.

    One ray a pixel is enough: the level of the texture is chosen so that nothing finer than
    two pixels is left in it. Where the lens has no ray, the picture is black.
    """
    optics = optics_of(lens)
    rays = np.tensordot(T_world_camera[:3, :3].astype(np.float32), optics.rays, 1)
    origin = T_world_camera[:3, 3]
    reach, axis = box_hit(origin, rays)
    corner = np.float32((origin - ROOM_LOW_M) / TEXEL_M)
    x, y, z = (start + (reach / np.float32(TEXEL_M)) * ray for start, ray in zip(corner, rays, strict=True))
    texel_u = np.where(axis == 0, y, x)
    texel_v = np.where(axis == 2, y, z + np.float32(1500) * axis.astype(np.float32))
    slant = np.abs(np.choose(axis, rays))
    level = np.log2(reach * optics.pixel_rad / (TEXEL_M * np.sqrt(slant)))
    picture = np.round(sampled(texel_u, texel_v, np.clip(level, 0, 5)))
    return np.where(optics.seen, picture, 0).astype(np.uint8)


@dataclass(frozen=True, slots=True)
class Optics:
    """A lens as float32 arrays: unit rays (3, H, W), which pixels have one, and how wide each is."""

    rays: np.ndarray
    seen: np.ndarray
    pixel_rad: np.ndarray


@cache
def optics_of(lens: Camera) -> Optics:
    rays = lens.rays(pixel_grid(lens))
    seen = np.isfinite(rays).all(-1)
    rays = np.where(seen[..., None], rays, [0.0, 0.0, 1.0])
    pixel_rad = np.linalg.norm(np.diff(rays, axis=1, append=rays[:, -2:-1]), axis=-1)
    planes = np.ascontiguousarray(np.moveaxis(rays, -1, 0), np.float32)
    return Optics(planes, seen, np.clip(pixel_rad, 1e-4, 0.1).astype(np.float32))


def sampled(texel_u: np.ndarray, texel_v: np.ndarray, level: np.ndarray) -> np.ndarray:
    """The texture at fractional texels, linear in place and in level."""
    out = np.zeros(level.shape, np.float32)
    for k, texture in enumerate(texture_levels()):
        share = np.maximum(0, 1 - np.abs(level - k))
        if share.any():
            out += share * cv2.remap(texture, texel_u / 2**k, texel_v / 2**k, cv2.INTER_LINEAR)
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
