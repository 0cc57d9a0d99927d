#version 410 core
#extension GL_ARB_shading_language_420pack : require
// The mean of a pixel's samples, weighted.
layout(binding = 2) uniform sampler2DArray samples;
uniform int count;
uniform vec4 weight;  // of the channels
out vec4 frag_color;

void main()
{
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec4 total = texelFetch(samples, ivec3(at, 0), 0);
    for (int i = 1; i < count; i++) total += texelFetch(samples, ivec3(at, i), 0);
    total *= weight;
#ifdef IS_MONO
    frag_color = vec4(total.r + total.g + total.b, 0.0, 0.0, 1.0);
#else
    frag_color = total;
#endif
}
