#version 410 core
#extension GL_ARB_shading_language_420pack : require
// A mirrored picture with one value a pixel: mean luminance, mean of 1 / depth, and that it is known at all.
layout(binding = 2) uniform sampler2DArray samples;
layout(binding = 3) uniform sampler2DArray depths;
uniform int count;
uniform float near_m;
uniform float far_m;
out vec4 frag_color;

void main()
{
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec2 total = vec2(0.0);
    for (int i = 0; i < count; i++) {
        float screen = 2.0 * texelFetch(depths, ivec3(at, i), 0).r - 1.0;
        float nearness = (far_m + near_m - screen * (far_m - near_m)) / (2.0 * near_m * far_m);
        total += vec2(texelFetch(samples, ivec3(at, i), 0).r, nearness);
    }
    frag_color = vec4(total / float(count), 1.0, 1.0);
}
