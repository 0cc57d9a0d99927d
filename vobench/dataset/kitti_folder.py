"""The names of files and cameras in a folder of KITTI's odometry benchmark, and the axes of its body."""

from vobench.geometry.rig import looking

GREY_PAIR = ("image_0", "image_1")
COLOUR_PAIR = ("image_2", "image_3")
PAIRS = (GREY_PAIR, COLOUR_PAIR)  # in order of preference
CALIBRATION = "calib.txt"
TIMES = "times.txt"
POSES = "poses.txt"
POSES_FOLDER = "poses"  # beside the folders of the sequences
# The body has its origin in the left grey camera. The body's axes are x ahead, y left, z up; the camera's are x right,
# y down, z ahead.
T_BODY_GREY = looking(pitch_deg=0.0, position_m=(0.0, 0.0, 0.0))


def matrix_name(camera_folder: str) -> str:
    """The name in calib.txt of the projection matrix of a camera; image_0 has P0."""
    return f"P{camera_folder[-1]}"
