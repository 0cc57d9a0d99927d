"""What a scene is: flat surfaces, materials with procedural textures, and lights. Pure."""
