"""Whatever is wrong with a dataset is one sentence that names the file."""

import os
import shutil

import cv2
import numpy as np
import pytest

from vobench.dataset.layout import read
from vobench.dataset.recording import ReadOptions, Topics
from vobench.errors import VobenchError

POINTER = "version https://git-lfs.github.com/spec/v1\noid sha256:4d7a\nsize 12345\n"


def complaint(path, **options) -> str:
    """What is said of a recording, at once or when its pictures come; it is one line."""
    with pytest.raises(VobenchError) as caught:
        list(read(path, options=ReadOptions(**options)).frames())
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.fixture
def euroc(scene, tmp_path):
    return scene.euroc(tmp_path / "euroc")


@pytest.fixture
def kitti(scene, tmp_path):
    return scene.kitti(tmp_path / "kitti")


def picture(scene, folder, index=2, eye="cam0"):
    return folder / "mav0" / eye / "data" / f"{scene.t_ns[index]}.png"


def edit(path, change):
    path.write_text(change(path.read_text()))
    return path


def test_a_missing_calibration(euroc, kitti):
    sensor = euroc / "mav0/cam1/sensor.yaml"
    sensor.unlink()
    assert complaint(euroc).endswith(str(sensor))
    (kitti / "calib.txt").unlink()
    assert complaint(kitti) == (
        f"the calibration is missing; name a camchain.yaml of Kalibr's or put it here: {kitti / 'calib.txt'}"
    )


def test_a_missing_image(euroc, kitti, scene):
    for gone in (euroc / "mav0/cam1/data").iterdir():
        gone.unlink()
    lists = " and ".join(str(euroc / "mav0" / name / "data.csv") for name in ("cam0", "cam1"))
    first = picture(scene, euroc, 0, "cam1")
    assert complaint(euroc) == f"the files of all 5 pairs in {lists} are missing; the first missing file is {first}"
    (kitti / "image_1/000002.png").unlink()
    assert complaint(kitti) == f"an image is missing: {kitti / 'image_1' / '000002.png'}"


def test_left_and_right_counts_that_differ(kitti):
    (kitti / "image_1/000004.png").unlink()
    said = complaint(kitti)
    assert said.startswith("5 left and 4 right images")
    assert str(kitti / "image_1") in said


def test_fewer_times_than_pictures(kitti):
    edit(kitti / "times.txt", lambda text: "".join(text.splitlines(keepends=True)[:-1]))
    assert complaint(kitti) == f"4 times for 5 images in {kitti / 'image_0'}: {kitti / 'times.txt'}"


def test_shuffled_stamps(euroc):
    def swap(text):
        rows = text.splitlines()
        return "\n".join([rows[0], rows[2], rows[1], *rows[3:]])

    path = edit(euroc / "mav0/cam0/data.csv", swap)
    assert complaint(euroc).startswith(f"{path}:3: stamps must increase")


def test_repeated_stamps(kitti):
    path = edit(kitti / "times.txt", lambda text: text.replace(text.splitlines()[2], text.splitlines()[1]))
    assert complaint(kitti).startswith(f"{path}:3: stamps must increase")


def test_a_wrong_image_size(euroc, scene):
    wrong = picture(scene, euroc)
    wrong.write_bytes(cv2.imencode(".png", np.zeros((30, 48), np.uint8))[1].tobytes())
    said = complaint(euroc)
    assert "48 x 32 pixels" in said
    assert "48 x 30 pixels" in said
    assert said.endswith(str(wrong))


def test_a_calibration_of_another_size(euroc):
    path = edit(euroc / "mav0/cam0/sensor.yaml", lambda text: text.replace("[48, 32]", "[752, 480]"))
    assert complaint(euroc) == (
        f"the first left image has 48 x 32 pixels, but the calibration is for 752 x 480: {path}"
    )


def test_one_colour_picture_among_grey_ones(euroc, scene):
    wrong = picture(scene, euroc)
    wrong.write_bytes(cv2.imencode(".png", np.zeros((32, 48, 3), np.uint8))[1].tobytes())
    assert complaint(euroc).endswith(f"but this one has 48 x 32 pixels, 8-bit colour: {wrong}")


@pytest.mark.parametrize("word", ["inf", "Inf", "nan", "1e999"])
def test_an_inf_in_a_pose(euroc, kitti, word):
    def spoil(text, separator):
        rows = text.splitlines()
        cells = rows[2].split(separator)
        rows[2] = separator.join([*cells[:2], word, *cells[3:]])
        return "\n".join(rows)

    path = edit(euroc / "mav0/state_groundtruth_estimate0/data.csv", lambda text: spoil(text, ","))
    assert complaint(euroc).startswith(f"{path}:3: ")
    path = edit(kitti.parent.parent / "poses/00.txt", lambda text: spoil(text, " "))
    assert complaint(kitti).startswith(f"{path}:3: r13 should be a finite number")


def test_an_empty_folder(tmp_path):
    (tmp_path / "nothing").mkdir()
    assert complaint(tmp_path / "nothing") == f"an empty folder: {tmp_path / 'nothing'}"


def test_a_git_lfs_pointer_for_a_picture(euroc, scene):
    picture(scene, euroc).write_text(POINTER)
    said = complaint(euroc)
    assert said.startswith("a Git-LFS pointer, not the file itself; fetch it with git lfs pull")
    assert said.endswith(str(picture(scene, euroc)))


@pytest.mark.parametrize(
    "name", ["cam0/data.csv", "cam0/sensor.yaml", "imu0/data.csv", "state_groundtruth_estimate0/data.csv"]
)
def test_a_git_lfs_pointer_for_a_text(euroc, name):
    (euroc / "mav0" / name).write_text(POINTER)
    said = complaint(euroc)
    assert "Git-LFS pointer" in said
    assert said.endswith(name)


def test_a_git_lfs_pointer_for_a_bag(tmp_path):
    path = tmp_path / "run.bag"
    path.write_text(POINTER)
    assert "Git-LFS pointer" in complaint(path)


@pytest.mark.parametrize("share", [0.0, 0.3, 0.6, 0.99])
def test_a_picture_that_is_cut_off(euroc, scene, share):
    path = picture(scene, euroc)
    data = path.read_bytes()
    path.write_bytes(data[: int(len(data) * share)])
    said = complaint(euroc)
    assert "cut off" in said or "it is empty" in said
    assert said.endswith(str(path))


def test_a_picture_with_a_flipped_bit(euroc, scene):
    path = picture(scene, euroc)
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 4
    path.write_bytes(bytes(data))
    assert complaint(euroc).startswith("the PNG is damaged")


def test_something_that_is_no_picture(euroc, scene):
    picture(scene, euroc).write_bytes(b"<!doctype html>")
    assert complaint(euroc).startswith("an image should be a PNG or JPEG file, but it begins with b'<!doctyp'")


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("1403636579763555584", "a row should be a stamp and an image's name"),
        ("soon,a.png", "a row should be a stamp and an image's name"),
        ("1e400,a.png", "t should be nanoseconds below"),
    ],
)
def test_a_list_with_a_row_that_is_none(euroc, row, said):
    path = edit(euroc / "mav0/cam0/data.csv", lambda text: text + row + "\n")
    assert complaint(euroc).startswith(f"{path}:7: {said}")


def test_a_list_without_a_row(euroc):
    path = edit(euroc / "mav0/cam0/data.csv", lambda text: text.splitlines()[0])
    assert complaint(euroc) == f"the list has no image: {path}"


@pytest.mark.parametrize(
    "name", ["../../../../etc/passwd", "/etc/passwd", "a/../../b.png", "..\\..\\b.png", "C:\\b.png"]
)
def test_a_list_that_points_out_of_its_folder(euroc, name):
    edit(euroc / "mav0/cam0/data.csv", lambda text: text.splitlines()[0] + f"\n5,{name}\n")
    said = complaint(euroc)
    assert "should stay inside" in said
    assert ":2:" in said


def test_columns_that_are_too_few(euroc):
    path = edit(euroc / "mav0/imu0/data.csv", lambda text: text + "1503636579763555584,1,2,3\n")
    assert complaint(euroc).startswith(f"{path}:44: a reading has 7 columns (t wx wy wz ax ay az), this line has 4")


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda text: text.replace("rate_hz: 20", "rate_hz: [20"), "not valid YAML"),
        (lambda text: text.replace("intrinsics:", "intrinsic:"), "the key intrinsics is missing"),
        (lambda text: text.replace("23.5", ".nan"), "intrinsics.2 should be a finite number, but is nan"),
        (lambda text: text.replace("40.5", "-40.5"), "fx and fy above 0"),
        (lambda text: text.replace("radial-tangential", "thin-prism"), "the distortion model 'thin-prism'"),
        (lambda text: text.replace("rows: 4", "rows: 4\n  data: 5"), "not valid YAML"),
        (lambda text: "- 1\n- 2\n", "should be keys with values"),
        (lambda text: "a: &x [1]\nb: *x\n", "may not use a YAML alias (*x)"),
        (lambda text: "[" * 3000, "at most 500 brackets, not 3000"),
    ],
)
def test_a_yaml_that_says_no_camera(euroc, spoil, said):
    path = edit(euroc / "mav0/cam0/sensor.yaml", spoil)
    answer = complaint(euroc)
    assert answer.startswith(str(path))
    assert said in answer


def test_a_text_that_is_binary(euroc):
    path = euroc / "mav0/cam0/data.csv"
    path.write_bytes(b"\xff\xfe1\x004\x00")
    assert complaint(euroc).endswith(str(path))


def test_a_stamp_that_ros_cannot_hold(kitti):
    edit(kitti / "times.txt", lambda text: text.replace(text.splitlines()[-1], "2200000000.5"))
    assert "within 0 and 2147483647999999999 ns" in complaint(kitti)
    edit(kitti / "times.txt", lambda text: "-1.5\n" + text.partition("\n")[2])
    assert "an image has -1500000000" in complaint(kitti)


def test_two_cameras_in_one_place(euroc, kitti):
    shutil.copy(euroc / "mav0/cam0/sensor.yaml", euroc / "mav0/cam1/sensor.yaml")
    said = "the left and the right camera should be more than 1e-06 m apart, but are 0 m apart: "
    assert complaint(euroc) == f"{said}{euroc / 'mav0/cam0/sensor.yaml'}"
    edit(kitti / "calib.txt", lambda text: text.replace(" -20.0 ", " 0.0 "))
    assert complaint(kitti) == f"{said}{kitti / 'calib.txt'}"


def test_a_chain_with_one_camera_for_two(euroc, tmp_path, camchain):
    chain = tmp_path / "chain.yaml"
    chain.write_text(camchain(cameras=1))
    assert complaint(euroc, calibration=chain) == f"a pair of cameras needs cam1, which is missing in {chain}"


def test_a_chain_that_does_not_say_where_the_imu_is(euroc, tmp_path, camchain):
    chain = tmp_path / "chain.yaml"
    chain.write_text(camchain(imu=False))
    assert complaint(euroc, calibration=chain).endswith(f"T_cam_imu: {chain}")


def test_an_option_that_would_mean_nothing(kitti):
    assert complaint(kitti, rate_hz=10.0) == (
        "the option rate_hz does not apply to a recording of the form kitti; the options that apply: calibration, truth"
    )
    assert "the option topics" in complaint(kitti, topics=Topics(left="/left"))


def test_a_form_that_is_none(kitti):
    with pytest.raises(VobenchError, match=r"no form named 'kity'\. Did you mean 'kitti'\? Known: euroc"):
        read(kitti, form="kity")


@pytest.mark.skipif(os.geteuid() == 0, reason="root may read everything")
def test_a_file_that_may_not_be_read(euroc):
    path = euroc / "mav0/cam0/data.csv"
    path.chmod(0)
    assert complaint(euroc) == f"cannot read {path}: Permission denied"


def test_a_folder_where_a_file_should_be(kitti):
    (kitti / "times.txt").unlink()
    (kitti / "times.txt").mkdir()
    assert complaint(kitti) == f"not a file: {kitti / 'times.txt'}"
    shutil.rmtree(kitti / "times.txt")
    assert complaint(kitti) == f"no such file: {kitti / 'times.txt'}"


def test_two_pictures_of_one_number(kitti):
    shutil.copy(kitti / "image_0/000002.png", kitti / "image_0/000002_left.png")
    assert complaint(kitti) == f"two images have the number 2: {kitti / 'image_0/000002_left.png'}"


@pytest.mark.parametrize("rate_hz", [0.0, -1.0, float("nan"), float("inf")])
def test_a_rate_that_is_none(scene, tmp_path, rate_hz):
    assert "rate_hz should be above 0" in complaint(scene.tartanair(tmp_path), rate_hz=rate_hz)
