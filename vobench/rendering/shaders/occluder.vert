#version 410 core
#extension GL_ARB_shading_language_420pack : require
// A moving body as one sample of an emitter sees it, in its tile of the shadow atlas.
layout(location = 0) in vec3 position;
layout(binding = 1) uniform samplerBuffer maps;  // of each: across, across, along, and 1 if it is seen from a place
uniform int first_map;
uniform int columns;
uniform int rows;
out float gl_ClipDistance[4];

const float NEAR_M = 0.05;  // nearness is this over the distance

void main()
{
    int map = first_map + gl_InstanceID;
    vec4 world = vec4(position, 1.0);
    vec2 across = vec2(dot(texelFetch(maps, 4 * map), world), dot(texelFetch(maps, 4 * map + 1), world));
    float along = dot(texelFetch(maps, 4 * map + 2), world);
    bool is_near = texelFetch(maps, 4 * map + 3).x > 0.0;
    float w = is_near ? along : 1.0;
    gl_ClipDistance[0] = w + across.x;
    gl_ClipDistance[1] = w - across.x;
    gl_ClipDistance[2] = w + across.y;
    gl_ClipDistance[3] = w - across.y;
    vec2 count = vec2(columns, rows), tile = vec2(map % columns, map / columns);
    gl_Position = vec4((across + (2.0 * tile + 1.0 - count) * w) / count, is_near ? NEAR_M : along, w);
}
