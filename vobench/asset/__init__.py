"""The parts of scenes: textures, shapes, furniture, rooms, and models from files."""

# Names that a scene's YAML may say, for those who need no more than the names: kinds of furniture, finishes of rooms
# (both of `asset.room`), kinds of panoramas, roles of a model's nodes, endings of models' files.
# fmt: off
FURNITURE = (
    "bench", "blind", "bollard", "book_stack", "bush", "cabinet", "cables", "car", "carton", "chair", "crate",
    "curtain", "desk", "desk_lamp", "dining_chair", "door", "floor_lamp", "framed", "fruit_bowl", "glass_wall",
    "keyboard", "lamp_housing", "low_board", "monitor", "mouse", "mug", "noticeboard", "papers", "park_bench",
    "park_lamp", "pendant", "pens", "person", "pillar", "pipe", "plant", "radiator", "rock", "rug", "shelf",
    "skirting", "socket", "sofa", "spot_housing", "street_lamp", "table", "television", "tree", "waste_bin",
    "window_frame",
)
FINISHES = (
    "brick", "carpet", "ceiling_tiles", "concrete", "mirror", "oak_floor", "paint", "pane", "paving", "sage_plaster",
    "terrazzo", "white_plaster",
)
# fmt: on
PANORAMAS = ("city", "suburb", "country")
ROLES = ("mirror", "pane", "lamp", "mover", "ignored")
MODEL_SUFFIXES = (".glb", ".gltf", ".obj", ".stl", ".ply")
