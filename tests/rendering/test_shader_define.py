"""The names that Python defines are those that the shaders ask for."""

import re

import pytest

pytest.importorskip("OpenGL.GL")

from vobench.rendering.shader_define import ShaderDefine
from vobench.rendering.shader_program import SHADERS


def test_the_shaders_ask_for_exactly_these_names() -> None:
    names = set()
    for path in SHADERS.iterdir():
        if path.stem in {"surface", "panorama", "mean", "background", "fullscreen"}:
            names |= set(re.findall(r"\b(?:IS|HAS)_[A-Z_]+\b", path.read_text(encoding="utf-8")))
    assert {str(define) for define in ShaderDefine} == names
