"""Render a picture of a scene from Python."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


def render(
    scene: str,
    *,
    seed: int | None = None,
    lighting: str = "drawn",
    camera: str = "paper_blender",
    at_m: tuple[float, float, float] = (0.0, 0.0, 1.2),
    yaw_deg: float = 0.0,
    pitch_deg: float = 10.0,
    time_s: float = 0.0,
    sensor: str = "clean",
    gain: float = 1.0,
    engine: str = "raster",
    samples: int | None = None,
) -> "NDArray[np.uint8]":
    """An RGB picture (H, W, 3) of a scene, the same that `vobench render` draws.

    Args:
        scene: The name of a scene, or the path of its file or model.
        seed: The seed of the place that the scene's generator creates; None for the scene as its file describes it.
        lighting: The lighting of that place: day, evening, night, overcast, or drawn by the seed.
        camera: A rig preset, whose left camera is used.
        at_m: The position of the camera in the world.
        yaw_deg: The yaw of the camera: 0 along x, 90 along y.
        pitch_deg: The pitch of the camera below the horizon.
        time_s: The time, for lights and things that change.
        sensor: The preset of the image sensor.
        gain: A factor of the exposure.
        engine: raster; path, Mitsuba's path tracer; or pyrender, the stock renderer.
        samples: Light paths per pixel, only for the engine path.

    Raises:
        UnknownNameError: No scene, camera or sensor has that name.
        InputError: A value is wrong, or the camera is outside the room.
        MissingDependencyError: This machine cannot render.
    """
    from vobench.runner.scene_picture import render_scene

    picture = render_scene(
        scene,
        seed=seed,
        lighting=lighting,
        camera=camera,
        at_m=at_m,
        yaw_deg=yaw_deg,
        pitch_deg=pitch_deg,
        time_s=time_s,
        sensor=sensor,
        gain=gain,
        engine=engine,
        samples=samples,
    )
    return picture.rgb
