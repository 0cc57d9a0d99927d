from pathlib import Path
from typing import Any

import pytest

from tests.asset.glb import Glb, Reader
from vobench.asset.model import Model, read_model


@pytest.fixture
def read(tmp_path: Path) -> Reader:
    def reading(glb: Glb | bytes, name: str = "thing.glb", **settings: Any) -> Model:
        path = tmp_path / name
        path.write_bytes(glb.bytes() if isinstance(glb, Glb) else glb)
        return read_model(path, **settings)

    return reading
