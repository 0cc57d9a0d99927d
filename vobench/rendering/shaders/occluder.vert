#version 410 core
#extension GL_ARB_shading_language_420pack : require
// A moving body as one sample of an emitter sees it, in its tile of the shadow atlas.
layout(location = 0) in vec3 position;
layout(binding = 1) uniform samplerBuffer maps;
uniform int first_map;
uniform int columns;
uniform int rows;
out float gl_ClipDistance[4];

void main()
{
    int map = first_map + gl_InstanceID;
    vec4 world = vec4(position, 1.0), seen;
    for (int i = 0; i < 4; i++) seen[i] = dot(texelFetch(maps, 4 * map + i), world);
    gl_ClipDistance[0] = seen.w + seen.x;
    gl_ClipDistance[1] = seen.w - seen.x;
    gl_ClipDistance[2] = seen.w + seen.y;
    gl_ClipDistance[3] = seen.w - seen.y;
    vec2 count = vec2(columns, rows), tile = vec2(map % columns, map / columns);
    gl_Position = vec4((seen.xy + (2.0 * tile + 1.0 - count) * seen.w) / count, seen.zw);
}
