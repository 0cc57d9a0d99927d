#version 410 core
#extension GL_ARB_shading_language_420pack : require
// What a rough mirror shows of all around where it is seen square on (GGX: Karis 2013, eq. 3 and the code there).
layout(binding = 0) uniform samplerCube around;
uniform mat3 axes;  // right, down and ahead of this face
uniform float roughness;
uniform float size_px;
uniform float around_px;
out vec4 frag_color;

const int RAYS = 64;
const float PI = 3.14159265358979;

void main()
{
    vec3 N = normalize(axes * vec3(2.0 * gl_FragCoord.xy / size_px - 1.0, 1.0));
    vec3 U = normalize(cross(abs(N.z) < 0.9 ? vec3(0.0, 0.0, 1.0) : vec3(1.0, 0.0, 0.0), N)), V = cross(N, U);
    vec3 light = vec3(0.0);
    float weights = 0.0;
    for (int i = 0; i < RAYS; i++) {
        float u = (float(i) + 0.5) / float(RAYS), turn = 2.0 * PI * 0.618033989 * float(i);
        float squared = roughness * roughness, t = 1.0 + (squared - 1.0) * u;
        float c = sqrt((1.0 - u) / t), s = sqrt(max(0.0, 1.0 - c * c));
        vec3 h = s * (cos(turn) * U + sin(turn) * V) + c * N;
        float weight = 2.0 * c * c - 1.0;
        if (weight <= 0.0) continue;
        // Each ray stands for its share of the lobe.
        float peak = c * c * (squared - 1.0) + 1.0, density = squared / (4.0 * PI * peak * peak);
        float texels = 1.5 * around_px * around_px / (PI * density * float(RAYS));
        light += weight * textureLod(around, 2.0 * dot(N, h) * h - N, 0.5 * log2(max(1.0, texels)) + 0.5).rgb;
        weights += weight;
    }
    frag_color = vec4(light / weights, 1.0);
}
