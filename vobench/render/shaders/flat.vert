#version 330 core
// Where a surface's corners fall in the picture; texture and light coordinates pass through.
layout(location = 0) in vec3 position;
#ifdef TEXCOORD_0_LOC
layout(location = TEXCOORD_0_LOC) in vec2 texcoord_0;
#endif
#ifdef TEXCOORD_1_LOC
layout(location = TEXCOORD_1_LOC) in vec2 texcoord_1;
#endif
layout(location = INST_M_LOC) in mat4 inst_m;

uniform mat4 M;
uniform mat4 V;
uniform mat4 P;

out vec2 uv_albedo;
out vec2 uv_light;

void main()
{
    gl_Position = P * V * M * inst_m * vec4(position, 1.0);
    uv_albedo = texcoord_0;
    uv_light = texcoord_1;
}
