"""Devices are listed by EGL, and tried in the order that is asked for."""

import pytest

from vobench.errors import MissingDependencyError
from vobench.rendering import egl_device
from vobench.rendering.egl_device import EglDevice, devices, listed, ordered

GPU = EglDevice(0, "/dev/dri/card0", is_software=False, handle=1)
SECOND_GPU = EglDevice(1, "/dev/dri/card1", is_software=False, handle=2)
CPU = EglDevice(2, "Mesa software driver", is_software=True, handle=3)


def test_the_cpu_comes_before_gpus_whatever_the_order_of_the_list() -> None:
    assert ordered([GPU, SECOND_GPU, CPU], "") == [CPU, GPU, SECOND_GPU]


@pytest.mark.parametrize(
    ("wanted", "chosen"),
    [("cpu", [CPU]), ("gpu", [GPU, SECOND_GPU]), ("GPU ", [GPU, SECOND_GPU]), ("1", [SECOND_GPU]), ("2", [CPU])],
)
def test_a_setting_chooses_the_device(wanted: str, chosen: list[EglDevice]) -> None:
    assert ordered([GPU, SECOND_GPU, CPU], wanted) == chosen


@pytest.mark.parametrize("wanted", ["3", "-1", "nvidia"])
def test_a_device_that_is_not_listed_is_refused_with_those_that_are(wanted: str) -> None:
    with pytest.raises(MissingDependencyError, match=r"should be cpu, gpu or the number of a device, got ") as caught:
        ordered([GPU, CPU], wanted)
    assert "0: /dev/dri/card0 (GPU), 2: Mesa software driver (CPU)" in str(caught.value)
    assert repr(wanted) in str(caught.value)


def test_a_list_without_devices_says_so() -> None:
    assert listed([]) == "none"
    assert listed([GPU, CPU]) == "0: /dev/dri/card0 (GPU), 2: Mesa software driver (CPU)"


def test_the_devices_of_this_machine_have_names_and_handles() -> None:
    found = devices()
    assert found
    assert all(device.name for device in found)
    assert len({device.handle for device in found}) == len(found)


def test_without_the_extension_there_is_the_default_display_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(egl_device, "egl_function", lambda *_: None)
    (device,) = devices()
    assert device == EglDevice(0, "default display", is_software=False)
    assert device.handle is None


def test_a_function_that_egl_has_not_got_is_none() -> None:
    assert egl_device.egl_function("eglVobenchTelepathy", None) is None
