"""A textured picture, the same one shifted, and a grid of points in it."""

import cv2
import numpy as np


def texture(seed=0, size=(480, 720)):
    """Grain of every size from 4 px on."""
    rng = np.random.default_rng(seed)
    grains = [rng.uniform(-1, 1, (size[0] // k, size[1] // k)).astype(np.float32) for k in (4, 8, 16, 32)]
    summed = sum(cv2.resize(grain, size[::-1], interpolation=cv2.INTER_CUBIC) for grain in grains)
    return np.clip(128 + 45 * summed, 0, 255).astype(np.uint8)


def shifted(image, dx, dy):
    moving = np.float32([[1, 0, dx], [0, 1, dy]])
    return cv2.warpAffine(image, moving, image.shape[::-1], flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REFLECT)


def grid(n=9):
    return np.stack(np.meshgrid(np.linspace(60, 660, n), np.linspace(60, 420, n)), -1).reshape(-1, 2).astype(np.float32)
