#version 410 core
#extension GL_ARB_shading_language_420pack : require
// The mean of a pixel's samples, weighted.
layout(binding = 2) uniform sampler2DArray samples;
uniform int count;
uniform float weight;
out vec4 frag_color;

void main()
{
    ivec2 at = ivec2(gl_FragCoord.xy);
    float total = texelFetch(samples, ivec3(at, 0), 0).r;
    for (int i = 1; i < count; i++) total += texelFetch(samples, ivec3(at, i), 0).r;
    frag_color = vec4(weight * total, 0.0, 0.0, 1.0);
}
