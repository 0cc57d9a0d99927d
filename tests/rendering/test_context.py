"""A context is created on the device that is asked for; a machine or driver that cannot draw says so in one line."""

import ctypes.util
import sys
from dataclasses import replace

import pytest

from vobench.errors import MissingDependencyError
from vobench.rendering import context, gl_feature, gl_library
from vobench.rendering.context import Context, create_context, driver_facts
from vobench.rendering.egl_device import EglDevice
from vobench.rendering.gl_feature import missing_features

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
    assert gl_library.missing_libraries() == []
    created = create_context()
    assert missing_features() == []
    created.release()


def test_missing_libraries_are_named_with_the_line_that_installs_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ctypes.util, "find_library", lambda name: None)
    monkeypatch.setitem(sys.modules, "OpenGL.GL", None)
    monkeypatch.delattr("OpenGL.GL")
    sentence = refusal()
    assert "missing libEGL, libGL, libOpenGL" in sentence
    assert sentence.endswith(gl_library.EGL_REMEDY)


def test_a_pyopengl_that_is_too_old_is_named_with_the_command_that_renews_it(monkeypatch: pytest.MonkeyPatch) -> None:
    from OpenGL import GL

    monkeypatch.delattr(GL, "glClipControl")
    monkeypatch.setattr(gl_library, "version", lambda name: "3.1.0")
    sentence = refusal()
    assert "PyOpenGL 3.1.0 has no glClipControl" in sentence
    assert sentence.endswith(f"{sys.executable} -m pip install 'PyOpenGL>=3.1.10'")


def test_a_pyopengl_that_cannot_be_imported_is_named_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "OpenGL.GL", None)
    monkeypatch.delattr("OpenGL.GL")
    sentence = refusal()
    assert "cannot be imported" in sentence
    assert sentence.endswith(gl_library.PYOPENGL_REMEDY)


def test_a_driver_without_float_framebuffers_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    from OpenGL import GL

    monkeypatch.setattr(GL, "glCheckFramebufferStatus", lambda target: GL.GL_FRAMEBUFFER_UNSUPPORTED)
    sentence = refusal()
    assert "lacks a float framebuffer (GL_R32F), a float framebuffer (GL_RGBA32F)" in sentence
    assert sentence.endswith(gl_library.SOFTWARE_REMEDY)


def test_a_driver_without_a_function_is_refused_with_the_function_and_its_use(monkeypatch: pytest.MonkeyPatch) -> None:
    from OpenGL import GL

    class Absent:
        def __bool__(self) -> bool:
            return False

    monkeypatch.setattr(GL, "glClipControl", Absent())
    assert "lacks glClipControl (depth from 0 to 1)" in refusal()


def test_a_driver_without_a_shader_extension_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(gl_feature, "SHADER_EXTENSIONS", ("GL_VOBENCH_telepathy",))
    assert "lacks GL_VOBENCH_telepathy" in refusal()


def test_a_display_that_fails_is_one_line_too(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(device: EglDevice) -> None:
        raise AssertionError("eglInitialize\n\treturned 0")

    monkeypatch.setattr(context, "display_of", fail)
    sentence = refusal()
    assert "reports AssertionError: eglInitialize returned 0" in sentence
    assert sentence.endswith(gl_library.EGL_REMEDY)
