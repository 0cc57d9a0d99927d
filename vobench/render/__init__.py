"""Light: bakes it into maps, and makes pictures and exact depth of a scene."""
