"""The paths of entities in a recording in Rerun."""

from dataclasses import dataclass

WORLD = "world"
TRUTH_PATH = f"{WORLD}/ground_truth/path"
SCENE = f"{WORLD}/scene"
TRUTH_LEFT = f"{WORLD}/ground_truth/left"
TRUTH_RIGHT = f"{WORLD}/ground_truth/right"
ERROR = f"{WORLD}/error"
TRACKS = f"{TRUTH_LEFT}/tracks"
POSITION_ERROR = "position_error"
ROTATION_ERROR = "rotation_error"
STATUS = "status"
SUMMARY = "summary"
STATS = "stats"
COSTS = "costs"


@dataclass(frozen=True, slots=True)
class EstimatorEntities:
    """The paths of the entities of one estimator; `label` is the estimator's name in the recording."""

    label: str

    @property
    def path(self) -> str:
        """The estimated path."""
        return f"{WORLD}/{self.label}/path"

    @property
    def left(self) -> str:
        """The left camera at its estimated pose."""
        return f"{WORLD}/{self.label}/left"

    @property
    def points(self) -> str:
        """The points of the scene as the estimator reconstructs it."""
        return f"{WORLD}/{self.label}/points"

    @property
    def error_line(self) -> str:
        """The line from the true position to the estimated one."""
        return f"{ERROR}/{self.label}"

    @property
    def tracks(self) -> str:
        """The tracked points in the left picture."""
        return f"{TRACKS}/{self.label}"

    @property
    def tails(self) -> str:
        """The paths of the tracked points over the last frames."""
        return f"{self.tracks}/tails"

    @property
    def epipolar(self) -> str:
        """The true epipolar lines of tracked points."""
        return f"{self.tracks}/epipolar_lines"

    @property
    def position_error(self) -> str:
        """The curve of the position error."""
        return f"{POSITION_ERROR}/{self.label}"

    @property
    def rotation_error(self) -> str:
        """The curve of the rotation error."""
        return f"{ROTATION_ERROR}/{self.label}"

    @property
    def status(self) -> str:
        """The status of each frame."""
        return f"{STATUS}/{self.label}"

    @property
    def summary(self) -> str:
        """The text with the score."""
        return f"{SUMMARY}/{self.label}"


def truth_entity(side: str, channel: str) -> str:
    """The entity of a channel of per-pixel ground truth from one camera.

    It is outside of WORLD, because a depth image in the 3-D view would hide the paths.
    """
    return f"truth/{side}/{channel}"
