"""A place as the code beside a scene returns it: things, their materials, and lights."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from vobench.scene.light import Light
from vobench.scene.material import Material
from vobench.scene.triangles import Thing


@dataclass(frozen=True, slots=True)
class GeneratedPlace:
    """What `generate(seed, lighting)` of a generator returns: everything that is in a place.

    Every thing has a mesh (trimesh.Trimesh, in metres, z up, with the floor at z = 0), and names one of `materials`.
    A thing whose material emits light is a lamp. `lights` are further lamps, and at most one `Sun`, named "sun", and
    one `Sky`, named "sky", with or without a panorama (`Surroundings`). The exposure of cameras and the free space are
    found from these, so a generator does not return them.
    """

    things: Sequence[Thing]
    materials: Mapping[str, Material]
    lights: Sequence[Light] = field(default_factory=tuple)
