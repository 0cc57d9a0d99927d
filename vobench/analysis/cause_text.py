"""What explanations say about a cause: why an estimator fails, and what to do about it."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class CauseText:
    """The words about one cause: a clause that follows "because", and an advice in the imperative."""

    because: str
    advice: str


# By the names of `nuisance.NUISANCES` and of their parts.
CAUSE_TEXTS = {
    "mirrors": CauseText("mirrors and panes show things where they are not", "mask mirrors and panes in the images"),
    "gloss": CauseText("highlights move over glossy surfaces", "use softer light or a polarising filter"),
    "shadows": CauseText("shadows are strong", "use softer light, or a camera with more dynamic range"),
    "changing light": CauseText(
        "the light changes", "keep the light steady, or match images independently of their brightness"
    ),
    "moving things": CauseText("things move in the view", "reject points that move, by a stricter RANSAC or by masks"),
    "low texture": CauseText(
        "surfaces have little texture", "add texture, use a wider lens, or accept weaker features (a lower threshold)"
    ),
    "low light": CauseText("the light is low", "add light or expose longer"),
    "burnt pixels": CauseText("pixels are saturated", "expose shorter, or use a camera with more dynamic range"),
    "blur": CauseText("the images are blurred", "expose shorter and focus the lens"),
    "noise": CauseText("the images are noisy", "add light, expose longer with less gain, or smooth the images"),
    "unlike eyes": CauseText(
        "the two cameras differ", "give both cameras the same exposure and focus, or match independently of brightness"
    ),
    "unlike brightness": CauseText(
        "the two cameras are not equally bright",
        "give both cameras the same exposure, or match independently of brightness",
    ),
    "unlike lenses": CauseText(
        "the lenses of the two cameras differ", "focus and clean both lenses, or use the sharper camera alone"
    ),
    "dropped frames": CauseText("frames are missing", "find out why frames are dropped, such as by a slow bus or disk"),
    "late images": CauseText(
        "images are not taken at their time stamp",
        "trigger both cameras together, and stamp images when they are taken",
    ),
    "late IMU": CauseText("IMU readings are stamped late", "calibrate the time offset between IMU and camera"),
    "rolling shutter": CauseText(
        "the shutter is a rolling one", "use a global shutter, a faster readout, or a model of the readout"
    ),
    "auto-exposure": CauseText(
        "the exposure changes", "fix the exposure, slow its control down, or match independently of brightness"
    ),
    "vignetting and dirt": CauseText("the lens is dirty or dark at its borders", "clean the lens, or mask its borders"),
    "drops on the lens": CauseText("drops are on the lens", "shield or wipe the lens, or mask the drops"),
    "fog": CauseText("fog lowers the contrast", "use nearby points, or sensors that see through fog"),
    "rain": CauseText("rain falls, and wet ground mirrors", "reject outliers near the camera and on wet ground"),
    "wind": CauseText("leaves move in the wind", "reject outliers, and spread features over the picture"),
    "flare": CauseText("light strays in the lens", "shade or clean the lens"),
    "JPEG": CauseText("the images are compressed", "use a higher quality, or lossless images"),
    "calibration": CauseText("the calibration is wrong", "calibrate the cameras again"),
    "IMU errors": CauseText("the IMU has errors", "use a better IMU, or estimate its biases"),
    "wheel slip": CauseText("wheels slip", "give wheel odometry less weight where wheels slip"),
    "encoder errors": CauseText("the wheels are not of nominal size", "calibrate the wheels' radii and distance"),
    "speed": CauseText("the motion is fast", "move more slowly, or use a higher frame rate"),
    "fast turns": CauseText("turns are fast", "turn more slowly, or use a higher frame rate or a wider lens"),
    "low frame rate": CauseText("the frame rate is low", "use a higher frame rate"),
    "short baseline": CauseText("the baseline is short for these distances", "mount the cameras further apart"),
    "this place": CauseText("this place is difficult", "compare this place with others of its kind (vobench causes)"),
}
