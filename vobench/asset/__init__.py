"""The parts of scenes: textures, shapes, furniture, rooms, and models from files."""

# The names that a scene's YAML file can use, for code that must not import the modules that define them: kinds of
# furniture and finishes (`asset.room`), roles of a model's nodes, and suffixes of model files (`asset.model`).
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
ROLES = ("mirror", "pane", "lamp", "mover", "ignored")
MODEL_SUFFIXES = (".glb", ".gltf", ".obj", ".stl", ".ply")
