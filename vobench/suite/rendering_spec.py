"""What YAML may say of how pictures are drawn, and what is recorded of each beside it."""

from typing import Annotated

from pydantic import Field, model_validator

from vobench.sensor.truth import CHANNELS
from vobench.suite.strict import Strict, one_of

ENGINES = ("raster", "path")
MOST_SAMPLES = 65536
ChannelName = Annotated[str, one_of("ground-truth channel", CHANNELS)]


class RenderingSpec(Strict):
    """The engine: `raster` draws with light computed once, `path` traces `samples` light paths through each pixel.

    None are as many as the path tracer takes by itself.
    """

    engine: Annotated[str, one_of("engine", ENGINES)] = "raster"
    samples: Annotated[int, Field(ge=1, le=MOST_SAMPLES)] | None = None

    @model_validator(mode="after")
    def _samples_are_of_paths(self) -> "RenderingSpec":
        if self.engine != "path" and self.samples is not None:
            raise ValueError(f"samples belongs to engine path, but the engine is {self.engine}; leave samples out")
        return self
