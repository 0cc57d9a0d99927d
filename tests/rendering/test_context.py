"""A context is created on the device that is asked for; a machine or driver that cannot draw says so in one line."""

import ctypes.util
import sys
from dataclasses import replace

import pytest

from vobench.errors import MissingDependencyError
from vobench.rendering import context
from vobench.rendering.context import Context, EglDevice, create_context, driver_facts, ordered

GPU = EglDevice(0, "/dev/dri/card0", is_software=False, handle=1)
SECOND_GPU = EglDevice(1, "/dev/dri/card1", is_software=False, handle=2)
CPU = EglDevice(2, "Mesa software driver", is_software=True, handle=3)


def refusal() -> str:
    """The sentence with which no context is created."""
    with pytest.raises(MissingDependencyError) as caught:
        create_context()
    sentence = str(caught.value)
    assert "\n" not in sentence
    assert "; run: " in sentence
    return sentence


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


def test_this_machine_lists_a_device_of_each_index_and_draws_with_one_of_them(monkeypatch: pytest.MonkeyPatch) -> None:
    found = context.devices()
    assert [device.index for device in found] == list(range(len(found)))
    for device in found:
        monkeypatch.setenv(context.DEVICE_VARIABLE, str(device.index))
        created = create_context()
        assert created.device == device
        created.release()


def test_a_device_that_fails_gives_way_to_the_next(monkeypatch: pytest.MonkeyPatch) -> None:
    real = context.devices()[-1]
    broken = replace(real, index=7, name="broken", is_software=False)
    create = context._capable_context

    def fail_on_broken(device: EglDevice) -> Context:
        if device == broken:
            raise RuntimeError("no permission")
        return create(device)

    monkeypatch.setattr(context, "devices", lambda: [broken, real])
    monkeypatch.setattr(context, "_capable_context", fail_on_broken)
    created = create_context()
    assert created.device == real
    created.release()


def test_a_device_that_is_asked_for_and_fails_is_not_replaced_by_another(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(device: EglDevice) -> Context:
        raise RuntimeError("no permission")

    monkeypatch.setattr(context, "devices", lambda: [GPU, CPU])
    monkeypatch.setattr(context, "_capable_context", fail)
    monkeypatch.setenv(context.DEVICE_VARIABLE, "gpu")
    assert "EGL on device 0: /dev/dri/card0 (GPU) reports RuntimeError: no permission" in refusal()


def test_facts_name_the_driver_and_the_device() -> None:
    facts = driver_facts()
    assert facts.device in [str(device) for device in context.devices()]
    assert all((facts.renderer, facts.version, facts.vendor))


def test_a_machine_that_can_draw_lacks_nothing() -> None:
    assert context.missing_libraries() == []
    created = create_context()
    assert context.missing_features() == []
    created.release()


def test_missing_libraries_are_named_with_the_line_that_installs_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ctypes.util, "find_library", lambda name: None)
    monkeypatch.setitem(sys.modules, "OpenGL.GL", None)
    monkeypatch.delattr("OpenGL.GL")
    sentence = refusal()
    assert "missing libEGL, libGL, libOpenGL" in sentence
    assert sentence.endswith(context.EGL_REMEDY)


def test_only_what_is_missing_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    find = ctypes.util.find_library
    monkeypatch.setattr(ctypes.util, "find_library", lambda name: None if name == "EGL" else find(name))
    assert context.missing_libraries() == ["EGL"]


def test_a_library_that_is_no_library_is_missing_too(monkeypatch: pytest.MonkeyPatch, tmp_path) -> None:
    torn = tmp_path / "libEGL.so.1"
    torn.write_bytes(b"")
    find = ctypes.util.find_library
    monkeypatch.setattr(ctypes.util, "find_library", lambda name: str(torn) if name == "EGL" else find(name))
    assert context.missing_libraries() == ["EGL"]


def test_a_pyopengl_that_is_too_old_is_named_with_the_command_that_renews_it(monkeypatch: pytest.MonkeyPatch) -> None:
    from OpenGL import GL

    monkeypatch.delattr(GL, "glClipControl")
    monkeypatch.setattr(context, "version", lambda name: "3.1.0")
    sentence = refusal()
    assert "PyOpenGL 3.1.0 has no glClipControl" in sentence
    assert sentence.endswith(f"{sys.executable} -m pip install 'PyOpenGL>=3.1.10'")


def test_a_pyopengl_that_cannot_be_imported_is_named_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "OpenGL.GL", None)
    monkeypatch.delattr("OpenGL.GL")
    sentence = refusal()
    assert "cannot be imported" in sentence
    assert sentence.endswith(context.PYOPENGL_REMEDY)


def test_a_driver_without_float_framebuffers_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    from OpenGL import GL

    monkeypatch.setattr(GL, "glCheckFramebufferStatus", lambda target: GL.GL_FRAMEBUFFER_UNSUPPORTED)
    sentence = refusal()
    assert "lacks a float framebuffer (GL_R32F), a float framebuffer (GL_RGBA32F)" in sentence
    assert sentence.endswith(context.SOFTWARE_REMEDY)


def test_a_driver_without_a_function_is_refused_with_the_function_and_its_use(monkeypatch: pytest.MonkeyPatch) -> None:
    from OpenGL import GL

    class Absent:
        def __bool__(self) -> bool:
            return False

    monkeypatch.setattr(GL, "glClipControl", Absent())
    assert "lacks glClipControl (depth from 0 to 1)" in refusal()


def test_a_driver_without_a_shader_extension_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(context, "SHADER_EXTENSIONS", ("GL_VOBENCH_telepathy",))
    assert "lacks GL_VOBENCH_telepathy" in refusal()


def test_a_display_that_fails_is_one_line_too(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(device: EglDevice) -> None:
        raise AssertionError("eglInitialize\n\treturned 0")

    monkeypatch.setattr(context, "_display", fail)
    sentence = refusal()
    assert "reports AssertionError: eglInitialize returned 0" in sentence
    assert sentence.endswith(context.EGL_REMEDY)
