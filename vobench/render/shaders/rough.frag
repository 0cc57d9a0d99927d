#version 410 core
#extension GL_ARB_shading_language_420pack : require
// What a rough mirror shows: rays spread by its facets (GGX, visible normals: Heitz 2018), each sampled where it
// ends in the mirrored picture; the depths in that picture say how far they go.
layout(std140, binding = 0) uniform Pass {
    mat4 view_projection;
    vec4 eye;
    vec4 clip_plane;
    vec4 lod_bias;
    mat4 direct;
    vec4 mirrors[3];
};
layout(binding = 2) uniform sampler2D mirrored;  // luminance and 1 / depth, times the third: what share is known
uniform vec4 plane;
uniform float roughness;
uniform float eta;
uniform float focal_px;
in vec3 to_eye;
out vec4 frag_color;

const int RAYS = 16;
const float PI = 3.14159265358979;

float fresnel(float c)
{
    float inside = sqrt(1.0 - (1.0 - c * c) / (eta * eta));
    float across = (c - eta * inside) / (c + eta * inside);
    float along = (inside - eta * c) / (inside + eta * c);
    return 0.5 * (across * across + along * along);
}

// A facet's normal as seen from `view`, both in the mirror's axes with z along its normal and view.y = 0.
vec3 facet(vec3 view, vec2 random)
{
    vec3 stretched = normalize(vec3(roughness * view.x, 0.0, view.z));
    vec3 across = vec3(0.0, 1.0, 0.0), along = cross(stretched, across);
    float radius = sqrt(random.x), angle = 2.0 * PI * random.y, s = 0.5 * (1.0 + stretched.z);
    float a = radius * cos(angle), b = mix(sqrt(1.0 - a * a), radius * sin(angle), s);
    vec3 n = a * across + b * along + sqrt(max(0.0, 1.0 - a * a - b * b)) * stretched;
    return normalize(vec3(roughness * n.xy, max(0.0, n.z)));
}

// Smith's share of facets that a direction is not hidden from.
float seen(float cosine)
{
    float squared = cosine * cosine;
    return 2.0 / (1.0 + sqrt(1.0 + roughness * roughness * (1.0 - squared) / squared));
}

// Solid angle that one of the rays covers.
float spread(vec3 view, vec3 h)
{
    float t = h.z * h.z * (roughness * roughness - 1.0) + 1.0;
    float facets = roughness * roughness / (PI * t * t);
    return 4.0 * view.z / (float(RAYS) * facets * seen(view.z));
}

// Luminance and distance from the mirror of what is met on a ray that is thought to go `reach` far, and how much of
// it is known. Each ray samples as much of the picture as it covers.
vec3 sample_at(vec3 from, vec3 direction, float reach, float solid_angle)
{
    vec4 screen = view_projection * vec4(from + reach * direction, 1.0);
    float size = reach * focal_px / screen.w, lod = 0.5 * log2(max(1.0, solid_angle * size * size));
    vec3 found = textureLod(mirrored, 0.5 * screen.xy / screen.w + 0.5, lod).rgb;
    if (found.b < 1e-3) return vec3(0.0, reach, 0.0);
    found.rg /= found.b;
    vec3 end = eye.xyz + (from + reach * direction - eye.xyz) / (found.g * screen.w);
    return vec3(found.r, distance(end, from), found.b);
}

void main()
{
    vec3 view_world = normalize(to_eye), from = eye.xyz - to_eye;
    float height = dot(view_world, plane.xyz);
    vec3 forward = view_world - height * plane.xyz;
    forward = dot(forward, forward) > 1e-8 ? normalize(forward)
                                           : normalize(cross(plane.xyz, vec3(0.577, 0.211, 0.789)));
    mat3 axes = mat3(forward, cross(plane.xyz, forward), plane.xyz);
    vec3 view = vec3(sqrt(max(0.0, 1.0 - height * height)), 0.0, height);

    // How far rays go on the whole: at the mirror's image, then around it as far as they spread.
    vec2 nearness = texelFetch(mirrored, ivec2(gl_FragCoord.xy), 0).gb;
    float straight = length(to_eye) * max(0.0, gl_FragCoord.w * nearness.y / nearness.x - 1.0);
    straight = sample_at(from, -view_world, straight, float(RAYS) * spread(view, vec3(0.0, 0.0, 1.0))).y;

    float light = 0.0, known = 0.0, shares = 0.0;
    for (int i = 0; i < RAYS; i++) {
        vec3 h = facet(view, fract(vec2((float(i) + 0.5) / float(RAYS), float(i) * 0.618033989)));
        vec3 ray = 2.0 * dot(view, h) * h - view;
        if (ray.z <= 0.0) continue;
        // Behind the mirror, where its picture is.
        vec3 direction = axes * vec3(ray.xy, -ray.z);
        float solid_angle = spread(view, h);
        vec3 found = sample_at(from, direction, sample_at(from, direction, straight, solid_angle).y, solid_angle);
        float share = seen(ray.z);
#ifdef HAS_FRESNEL
        share *= fresnel(dot(view, h));
#endif
        shares += share;
        light += share * found.z * found.x;
        known += share * found.z;
    }
    // Rays that leave the picture of the mirror are taken to find what the others do.
    frag_color = vec4(light / max(known, 1e-6) * shares / float(RAYS), 0.0, 0.0, 1.0);
}
