"""What YAML may say of how pictures are drawn, and what is recorded of each beside it."""

from typing import Annotated

from pydantic import Field

from vobench.sensor.truth import CHANNELS
from vobench.suite.strict import Strict, one_of

ENGINES = ("raster", "path")
ChannelName = Annotated[str, one_of("ground-truth channel", CHANNELS)]


class RenderingSpec(Strict):
    """The engine: `raster` draws with light computed once, `path` traces `samples` light paths through each pixel."""

    engine: Annotated[str, one_of("engine", ENGINES)] = "raster"
    samples: Annotated[int, Field(ge=1, le=65536)] = 64
