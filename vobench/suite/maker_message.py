"""Encodes the scene of a maker as bytes that contain only data: things, materials and lights.

A maker runs in a separate process, whose output is not trusted. Each object in it must be of one of `CLASSES`, and the
types of its fields are checked before it is constructed.

The bytes consist of the length of a JSON header, the header, and the arrays, to which the header refers by offset.
"""

import json
import math
import struct
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import cache, partial
from typing import Annotated, Any, get_type_hints

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationError, create_model

from vobench.asset.panorama import Surroundings
from vobench.asset.texture import Procedural
from vobench.errors import SuiteError, VobenchError
from vobench.scene.generated_place import GeneratedPlace
from vobench.scene.light import (
    AreaLight,
    Dimmer,
    Flicker,
    Level,
    Panorama,
    PointLight,
    Scaled,
    Sky,
    SpotLight,
    Steady,
    Sun,
    Switched,
)
from vobench.scene.material import Material, Picture, Texture
from vobench.scene.mesh import as_arrays, as_mesh, has_texture_coordinates, is_mesh
from vobench.scene.mesh_arrays import MeshArrays
from vobench.scene.triangles import Thing

LIGHTS = (AreaLight, PointLight, SpotLight, Sun, Sky)
LEVELS = (Steady, Flicker, Dimmer, Switched, Scaled)
TEXTURES = (Picture, Procedural)
PARTS = (MeshArrays, Thing, Material, Surroundings)
CLASSES: dict[str, type] = {each.__name__: each for each in (*PARTS, *LIGHTS, *LEVELS, *TEXTURES)}
DTYPES = ("float64", "float32", "int64", "int32", "uint8", "bool")
# The exceptions that are raised when bytes are read that do not describe a scene.
UNREADABLE = (
    ValueError,
    KeyError,
    IndexError,
    TypeError,
    AttributeError,
    OverflowError,
    RecursionError,
    struct.error,
)
OBJECT = "object"
ARRAY = "array"
LENGTH = struct.Struct("<Q")  # the length of the header in bytes
ALIGNMENT = 16  # the offset of each array is a multiple of this number of bytes


def checked(returned: Any) -> GeneratedPlace:
    """The scene that `make(seed)` returned: things, materials by name and, optionally, lights.

    Raises SuiteError if it is not valid.
    """
    if not isinstance(returned, Sequence) or len(returned) not in (2, 3):
        raise SuiteError("should return things, materials by name and, optionally, lights")
    things, materials, *rest = returned
    lights = rest[0] if rest else ()
    return checked_place(GeneratedPlace(things, materials, lights))


def checked_place(returned: Any) -> GeneratedPlace:
    """The scene that `generate(seed, lighting)` returned. Raises SuiteError if it is not valid."""
    if not isinstance(returned, GeneratedPlace):
        raise SuiteError(f"should return a GeneratedPlace, not {type(returned).__name__}")
    materials = returned.materials
    if not isinstance(materials, Mapping):
        raise SuiteError(f"should return materials by name, not {type(materials).__name__}")
    things = _all_of("thing", returned.things, (Thing,))
    lights = _all_of("light", returned.lights, LIGHTS)
    _all_of("material", materials.values(), (Material,))

    missing = {thing.material for thing in things} - materials.keys()
    if missing:
        raise SuiteError(f"returns things without materials: {', '.join(sorted(map(str, missing)))}")
    for thing in things:
        _require_drawable(thing, materials[thing.material])
    return GeneratedPlace(things, dict(materials), lights)


def _all_of(noun: str, objects: Any, classes: tuple[type, ...]) -> tuple[Any, ...]:
    """The objects as a tuple. They may come from a generator.

    Raises SuiteError if they are not iterable, or if one of them is of another class.
    """
    try:
        listed = tuple(objects)
    except TypeError:
        raise SuiteError(f"should return a list of {noun}s, not {type(objects).__name__}") from None
    unexpected = [each for each in listed if not isinstance(each, classes)]
    if unexpected:
        names = " or ".join(each.__name__ for each in classes)
        raise SuiteError(f"returns a {noun} that is no {names}: {type(unexpected[0]).__name__}")
    return listed


def _require_drawable(thing: Thing, material: Material) -> None:
    """Raise SuiteError if the mesh of a thing cannot be drawn."""
    if not is_mesh(thing.mesh):
        kind = type(thing.mesh).__name__
        raise SuiteError(f"returns '{thing.name}' with a mesh of type {kind}; it should be a trimesh.Trimesh")
    if material.texture is not None and not has_texture_coordinates(thing.mesh):
        advice = "set mesh.visual = trimesh.visual.TextureVisuals(uv=...)"
        raise SuiteError(f"returns '{thing.name}' with a texture but without texture coordinates; {advice}")
    try:
        _require_sound(as_arrays(thing.mesh))
    except SuiteError as error:
        raise SuiteError(f"returns '{thing.name}' with a mesh whose {error}") from None


def _require_sound(mesh: MeshArrays) -> None:
    """Raise SuiteError if the arrays of a mesh do not fit together, or if a number is not finite."""
    vertex_count = len(mesh.vertices_m)
    shapes: dict[str, tuple[NDArray[Any], tuple[int, int]]] = {
        "vertices": (mesh.vertices_m, (vertex_count, 3)),
        "texture coordinates": (mesh.uv, (vertex_count, 2)),
        "normals": (mesh.normals, (vertex_count, 3)),
        "faces": (mesh.faces, (len(mesh.faces), 3)),
    }
    for name, (array, shape) in shapes.items():
        if array.shape != shape:
            raise SuiteError(f"{name} have shape {array.shape}, where {shape} is right")
        if not np.isfinite(array).all():
            raise SuiteError(f"{name} have a number that is not finite")
    if not len(mesh.faces):
        return
    lowest_index = mesh.faces.min()
    highest_index = mesh.faces.max()
    if lowest_index < 0 or highest_index >= vertex_count:
        raise SuiteError("faces name a vertex that is not there")


# Writing


class _Writer:
    """Lists objects in an order in which they can be constructed. An object that is used twice is listed once."""

    def __init__(self) -> None:
        self.objects: list[dict[str, Any]] = []
        self.arrays: list[bytes] = []
        self._offset = 0
        self._indices: dict[int, int] = {}
        self._alive: list[Any] = []  # keeps the objects, so that their ids are not used again

    def value(self, value: Any) -> Any:
        """The value of a field in JSON form."""
        if isinstance(value, np.ndarray):
            return {ARRAY: self._array(value)}
        if isinstance(value, np.generic):
            return value.item()
        if isinstance(value, list | tuple):
            return [self.value(each) for each in value]
        if value is None or isinstance(value, str | int | float | bool):
            return value
        return {OBJECT: self.index_of(value)}

    def index_of(self, thing: Any) -> int:
        """The index of an object in the list. A new object is added."""
        if id(thing) in self._indices:
            return self._indices[id(thing)]
        class_name, encoded_fields = self._encoded(thing)
        index = len(self.objects)
        self.objects.append({"class": class_name, "fields": encoded_fields})
        self._alive.append(thing)
        self._indices[id(thing)] = index
        return index

    def _encoded(self, thing: Any) -> tuple[str, dict[str, Any]]:
        """The name of the class that an object is encoded as, and its fields in JSON form.

        Raises SuiteError for an object of a class that is not supported.
        """
        if is_mesh(thing):
            return MeshArrays.__name__, self._fields(as_arrays(thing))
        thing_class: type = type(thing)
        is_supported = CLASSES.get(thing_class.__name__) is thing_class
        if is_supported and is_dataclass(thing):
            return thing_class.__name__, self._fields(thing)
        if callable(getattr(thing, "pixels", None)):
            # A texture whose class the maker defines itself is sent as its picture.
            values = self.value(np.asarray(thing.pixels()))
            tile_m = self.value(thing.tile_m)
            return Picture.__name__, {"values": values, "tile_m": tile_m}
        known = ", ".join(CLASSES)
        raise SuiteError(f"returns something of class {thing_class.__name__}, which is none of {known}")

    def _fields(self, thing: Any) -> dict[str, Any]:
        """The fields of a dataclass in JSON form, by name."""
        return {field.name: self.value(getattr(thing, field.name)) for field in fields(thing)}

    def _array(self, array: Any) -> dict[str, Any]:
        """Add an array, and return its dtype, shape and offset."""
        name = array.dtype.name
        if name not in DTYPES:
            raise SuiteError(f"returns an array of {name}, which is none of {', '.join(DTYPES)}")
        content = np.ascontiguousarray(array).tobytes()
        offset = self._offset
        padding = b"\0" * (-len(content) % ALIGNMENT)
        self.arrays += [content, padding]
        self._offset += len(content) + len(padding)
        return {"dtype": name, "shape": list(array.shape), "offset": offset}


def encode(scene: GeneratedPlace) -> bytes:
    """The scene of a maker as bytes. Raises SuiteError if it contains an object of a class not in `CLASSES`."""
    writer = _Writer()
    header = {
        "things": [writer.index_of(thing) for thing in scene.things],
        "materials": {str(name): writer.index_of(material) for name, material in scene.materials.items()},
        "lights": [writer.index_of(light) for light in scene.lights],
        "objects": writer.objects,
    }
    text = json.dumps(header).encode("utf-8")
    unaligned_length = LENGTH.size + len(text)
    padding = b" " * (-unaligned_length % ALIGNMENT)
    padded_text = text + padding
    return b"".join([LENGTH.pack(len(padded_text)), padded_text, *writer.arrays])


# Reading


def decode(content: bytes) -> GeneratedPlace:
    """The scene of a maker from bytes that are not trusted. Raises SuiteError if they are not valid."""
    try:
        (length,) = LENGTH.unpack_from(content)
        header_end = LENGTH.size + length
        header = json.loads(content[LENGTH.size : header_end])
        arrays = memoryview(content)[header_end:]
        objects: list[Any] = []
        for entry in header["objects"]:
            objects.append(_object(entry, objects, arrays))
        materials = {name: objects[index] for name, index in header["materials"].items()}
        things = [objects[index] for index in header["things"]]
        lights = [objects[index] for index in header["lights"]]
    except ValidationError as error:
        mistake = error.errors()[0]
        field_path = ".".join(map(str, mistake["loc"]))
        raise SuiteError(f"returns a {error.title} with a wrong {field_path}: {mistake['msg']}") from None
    except VobenchError:
        raise
    except UNREADABLE as error:
        raise SuiteError(f"what the maker handed back cannot be read ({type(error).__name__}: {error})") from None
    return checked((things, materials, lights))


def _object(entry: Any, earlier: Sequence[Any], arrays: memoryview) -> Any:
    """The object that an entry of the header describes. Its fields may refer to the objects in `earlier` only."""
    name = entry["class"]
    values = {key: _value(value, earlier, arrays) for key, value in entry["fields"].items()}
    fields_read = _reader(name).model_validate(values)
    arguments = {key: getattr(fields_read, key) for key in values}
    instance = CLASSES[name](**arguments)
    if isinstance(instance, Picture):
        _require_picture(instance)
    if isinstance(instance, MeshArrays):
        _require_sound(instance)
        return as_mesh(instance)
    return instance


def _require_class(value: Any, *, classes: tuple[type, ...]) -> Any:
    """Return the value if it is of one of the classes. Raises ValueError otherwise."""
    if not isinstance(value, classes):
        names = " or ".join(each.__name__ for each in classes)
        raise ValueError(f"it should be of class {names}, not {type(value).__name__}")
    return value


def _instance_of(*classes: type) -> Any:
    """The type of a field that holds an object. The object itself was checked when it was constructed."""
    return Annotated[Any, AfterValidator(partial(_require_class, classes=classes))]


def _require_mesh(value: Any) -> Any:
    """Return the value if it is a mesh. Raises ValueError otherwise."""
    if not is_mesh(value):
        raise ValueError(f"it should be a mesh, not {type(value).__name__}")
    return value


class _Mesh:
    """Replaces trimesh.Trimesh in annotations, because this module does not import trimesh."""


# The annotations that replace those of fields which hold objects.
FIELD_VALIDATORS: dict[Any, Any] = {
    _Mesh: Annotated[Any, AfterValidator(_require_mesh)],
    Level: _instance_of(*LEVELS),
    Texture | None: _instance_of(*TEXTURES, type(None)),
    Panorama | None: _instance_of(Surroundings, type(None)),
}


@cache
def _reader(name: str) -> type[BaseModel]:
    """The pydantic model that checks the fields of a class in `CLASSES`.

    For arrays, only the type is checked, not the dtype or the shape.
    """
    known = CLASSES[name]
    hints = get_type_hints(known, localns={"Trimesh": _Mesh}, include_extras=True)
    required: dict[str, Any] = {}
    for field in fields(known):
        hint = hints[field.name]
        annotation = FIELD_VALIDATORS.get(hint, hint)
        required[field.name] = (annotation, ...)  # pydantic's notation for a field without a default
    config = ConfigDict(arbitrary_types_allowed=True, extra="forbid")
    return create_model(name, __config__=config, **required)


def _value(value: Any, earlier: Sequence[Any], arrays: memoryview) -> Any:
    """The value of a field from its JSON form. Lists become tuples."""
    if isinstance(value, list):
        return tuple(_value(each, earlier, arrays) for each in value)
    if not isinstance(value, dict):
        return value
    if OBJECT in value:
        return earlier[value[OBJECT]]
    return _array(value[ARRAY], arrays)


def _array(entry: Any, arrays: memoryview) -> Any:
    """The read-only array that an entry of the header describes."""
    name = entry["dtype"]
    shape = [int(length) for length in entry["shape"]]
    offset = int(entry["offset"])
    if name not in DTYPES or min([offset, *shape]) < 0:
        raise ValueError(f"an array of {name}, shape {shape}")
    return np.frombuffer(arrays, name, math.prod(shape), offset).reshape(shape)


def _require_picture(texture: Picture) -> None:
    """Raise SuiteError unless a picture is grey, or has three or four channels of 8 bits."""
    shape = texture.values.shape
    has_bytes = texture.values.dtype == np.uint8
    is_grey = len(shape) == 2
    is_colour = has_bytes and len(shape) == 3 and shape[2] in (3, 4)
    if not (is_grey or is_colour) or 0 in shape:
        kind = texture.values.dtype.name
        raise SuiteError(f"returns an image of shape {shape} and {kind}: (H, W) or uint8 (H, W, 3 or 4) is right")
