#version 410 core
#extension GL_ARB_shading_language_420pack : require
// Tiles of the light map: place and the bodies that may matter there.
layout(binding = 1) uniform samplerBuffer tiles;
uniform vec4 map_size;  // width and height of the map, side of a tile, in texels
flat out int near_bodies;

void main()
{
    vec4 tile = texelFetch(tiles, gl_InstanceID);
    vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);
    gl_Position = vec4(2.0 * (tile.xy + corner) * map_size.z / map_size.xy - 1.0, 0.0, 1.0);
    near_bodies = int(tile.z);
}
