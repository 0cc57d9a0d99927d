"""Rebuilds the place of a recording from its own stereo images, for a twin in which the same things are seen."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from vobench.analysis.conditions import RESPONSE_GAMMA
from vobench.analysis.keyframe_depth import keyframes_of, view_geometry
from vobench.analysis.keyframe_texture import without_noise
from vobench.analysis.path_placement import (
    NEAREST_COMPARED_PX,
    NEARNESS_VIEWS,
    OWN_SCALE,
    TENTHS,
    Placement,
    WantedDisparities,
    misfit_of,
)
from vobench.analysis.reconstruction import reconstruct
from vobench.analysis.recording_part import read_shots
from vobench.analysis.stereo_fit import StereoFit
from vobench.analysis.stereo_matches import MatchedShot, match_shots
from vobench.analysis.vignetting_fit import corrected, cosines, fit_photometry
from vobench.asset.luminous_model import write_luminous_model
from vobench.dataset.recording import Recording
from vobench.errors import InputError
from vobench.estimator.stereo import StereoPair, stereo_pair
from vobench.geometry.rig import Rig
from vobench.geometry.se3 import Array, inverse, rotation_angle
from vobench.rendering.geometry import RayCaster
from vobench.runner.store import SILENT, Progress
from vobench.scene.scene import triangles
from vobench.suite.scene_build import build
from vobench.suite.scene_spec import ModelSpec, SceneFile
from vobench.trajectory.trajectory import Stamps

RECORDED = "recorded"  # the name of the place
WHITE_CD_M2 = 1.0  # of a white texture, as written by `write_luminous_model`
COSINE_POWER = 4  # of the vignetting of strength 1
# By how much of its width the image may move between keyframes: the first that does not give too many of them.
STEP_SHARES = (0.03, 0.045, 0.06)
MOST_KEYFRAMES = 160
DISPARITY_QUANTILE = 0.99  # of the matches
TOO_NEAR_SHARE = 0.25  # of the images that are compared; a place is refused if surfaces are too near in more of them
FEWEST_MATCHES = 30  # of an image whose disparities are compared
BEYOND_MATCHES = 1.3  # the largest disparity that is searched, relative to that quantile


@dataclass(frozen=True, slots=True)
class RebuiltPlace:
    """A place that was rebuilt from a recording.

    `model` is its file, without vignetting; `vignetting` is the strength of that of the camera, as
    `CameraSettings.vignetting`. `pair` is the true pair, by which it was rebuilt. `matched` are some of the images,
    spread over the path, with their stereo matches by this pair.
    """

    model: Path
    vignetting: float
    pair: StereoPair
    matched: tuple[MatchedShot, ...]


def recorded_scene(model: Path) -> SceneFile:
    """The scene of a rebuilt place."""
    return SceneFile(name=RECORDED, white_cd_m2=WHITE_CD_M2, meshes=(ModelSpec(file=str(model)),))


def rebuild_place(
    recording: Recording,
    t_ns: Stamps,
    T_world_left: Array,
    rig: Rig,
    fit: StereoFit,
    *,
    model: Path,
    progress: Progress = SILENT,
) -> RebuiltPlace:
    """Rebuild the place of a recording from its images at `t_ns` (N,), and write its model.

    The model is in the world of the poses T_world_left (N, 4, 4) at which the images were taken, by the true `rig`,
    whose nominal calibration has the errors of `fit`.

    Raises InputError if the path is too long for that.
    """
    pair = stereo_pair(rig, "the twin")
    chosen = keyframe_indices(T_world_left, pair, typical_disparity_px=fit.disparity_px[1])
    with progress.step(f"rebuilding the place from {len(chosen)} images"):
        by_stamp = read_shots(recording, t_ns[chosen])
        shots = [replace(by_stamp[int(t_ns[index])], T_world_left=T_world_left[index]) for index in chosen]
        most_px = BEYOND_MATCHES * float(np.quantile(fit.matches.disparity_px, DISPARITY_QUANTILE))
        geometry = view_geometry(pair)
        keyframes = keyframes_of(shots, pair, geometry, most_disparity_px=most_px)
        cosine = cosines(pair, geometry)
        photometry = fit_photometry(keyframes, cosine, geometry)
        evenly_lit = corrected(keyframes, photometry, cosine)
        smooth = without_noise(evenly_lit, geometry)
        write_luminous_model(reconstruct(smooth, geometry), model)
        spread = np.unique(np.linspace(0, len(shots) - 1, NEARNESS_VIEWS).astype(int))
        matched = tuple(match_shots([shots[index] for index in spread], pair))
    return RebuiltPlace(model, photometry.exponent * RESPONSE_GAMMA / COSINE_POWER, pair, matched)


def keyframe_indices(T_world_left: Array, pair: StereoPair, *, typical_disparity_px: float) -> list[int]:
    """The indices of poses (N, 4, 4) between which the image moves by a small share of its width.

    Raises InputError if there are too many.
    """
    typical_rho = typical_disparity_px / pair.focal_baseline
    for step_share in STEP_SHARES:
        limit_px = step_share * pair.left.camera.width_px
        chosen = _spaced(T_world_left, float(pair.K[0, 0]), typical_rho, limit_px)
        if len(chosen) <= MOST_KEYFRAMES:
            return chosen
    raise InputError(
        f"the path is too long for rebuilding its place, which would take {len(chosen)} images, more than "
        f"{MOST_KEYFRAMES}; take a part of it, as by --frames 0:{len(T_world_left) * MOST_KEYFRAMES // len(chosen)}, "
        "or name a place by --place"
    )


def _spaced(T_world_left: Array, focal_px: float, typical_rho: float, limit_px: float) -> list[int]:
    """The first and the last index of poses, and those between at which the image has moved by more than a limit."""
    chosen = [0]
    for index in range(1, len(T_world_left)):
        T_last_this = inverse(T_world_left[chosen[-1]]) @ T_world_left[index]
        moved_m = float(np.linalg.norm(T_last_this[:3, 3]))
        turned_rad = float(rotation_angle(T_last_this[:3, :3]))
        if focal_px * (moved_m * typical_rho + turned_rad) > limit_px:
            chosen.append(index)
    if chosen[-1] != len(T_world_left) - 1:
        chosen.append(len(T_world_left) - 1)
    return chosen


def own_placement(
    place: RebuiltPlace, T_world_left: Array, nominal_pair: StereoPair, wanted: WantedDisparities
) -> Placement:
    """The placement of a path (N, 4, 4) in its rebuilt place, where it is.

    Raises InputError if surfaces are nearer there than in many images of the recording, as they are if the images do
    not determine their depth.
    """
    caster = RayCaster(triangles(build(recorded_scene(place.model), {})))
    misfit = misfit_of(caster, T_world_left, nominal_pair, 1.0, wanted)
    nearness = [_nearness(caster, matched, place.pair) for matched in place.matched]
    of_most = float(np.quantile(nearness, 1 - TOO_NEAR_SHARE))
    if of_most > OWN_SCALE.nearness:
        raise InputError(
            f"the place of the recording cannot be rebuilt: surfaces are {of_most:.1f} times as near as in the "
            "recording, because its images have too little light or texture; name a place by --place"
        )
    return Placement(np.eye(4), 1.0, misfit, max(nearness), tried=1)


def _nearness(caster: RayCaster, matched: MatchedShot, pair: StereoPair) -> float:
    """The larger ratio of a tenth of the disparities in a rebuilt place to that of an image, both at its matches.

    0 if there are too few matches.
    """
    T_world_left = matched.shot.T_world_left
    assert T_world_left is not None
    rays = pair.left.rays(matched.left_px) @ pair.left.R_view_camera  # of depth 1, in the axes of the camera
    origins_m = np.tile(T_world_left[:3, 3], (len(rays), 1))
    hits = caster.hits(origins_m, rays @ T_world_left[:3, :3].T)
    is_hit = hits.face >= 0
    if is_hit.sum() < FEWEST_MATCHES:
        return 0.0
    rebuilt_px = np.quantile(pair.focal_baseline / hits.distance[is_hit], TENTHS)
    recorded_px = np.quantile(matched.disparity_px[is_hit], TENTHS)
    return float((rebuilt_px / np.maximum(recorded_px, NEAREST_COMPARED_PX)).max())
