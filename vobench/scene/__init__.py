"""What a scene is: meshes, materials with procedural textures, and lights. Pure."""
