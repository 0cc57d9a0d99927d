#version 410 core
#extension GL_ARB_shading_language_420pack : require
// Light on the map: of the stationary part, what bodies take from it, and all that falls on moving bodies.
layout(binding = 0) uniform samplerBuffer maps;      // of each body and sample: four rows of a matrix
layout(binding = 2) uniform sampler2D atlas;         // nearness of bodies, seen from samples of emitters
layout(binding = 3) uniform samplerBuffer samples;   // of each: place, axis
layout(binding = 4) uniform samplerBuffer reach;     // strength of each sample at each probe, then at each body
layout(binding = 5) uniform samplerBuffer emitters;  // of each: first sample, count, light, row of hard light; ball; colour
layout(binding = 6) uniform samplerBuffer bodies;    // sphere of each
layout(binding = 7) uniform sampler2D base_light;    // the map without movers
layout(binding = 8) uniform sampler2D places;        // where each texel of the stationary part is
layout(binding = 9) uniform sampler2D normals;       // its face's normal, 0 for none
layout(binding = 10) uniform sampler2DArray direct;  // direct light of each light over its largest
layout(binding = 11) uniform isampler2D mover_texel; // the point of each texel of a mover, -1 for none
layout(binding = 12) uniform samplerBuffer points;   // of each: place and probe, normal and eta
layout(binding = 13) uniform samplerBuffer cubes;    // of each probe: light that faces along +-x, +-y and +-z gather
layout(binding = 14) uniform samplerBuffer hard;     // of each emitter with hard shadows and point: illuminance
uniform int emitter;
uniform int body_count;
uniform int sample_count;
uniform int probe_count;
uniform int point_count;
uniform int emitter_count;
uniform int first_sibling;
uniform int end_sibling;
uniform float largest;  // direct light
uniform vec4 atlas_size;  // columns, side of a tile, width and height
flat in int near_bodies;
out vec4 frag_color;

const int BITS = 24;          // of the mask of bodies, which is a float
const float CLEAR_M = 0.004;  // towards the light, from where a stationary place looks for bodies
const float OWN_M = 0.05;     // the same from a body, whose map shows it coarsely
const float STEEPEST = 0.999;
const float LEAST = 1e-6;     // nearness of what lies farther than a map shows

// Share of a place that a body hides from a sample.
float hidden(int body, int at_sample, vec3 from)
{
    int map = body * sample_count + at_sample;
    vec4 world = vec4(from, 1.0), seen;
    for (int i = 0; i < 4; i++) seen[i] = dot(texelFetch(maps, 4 * map + i), world);
    if (seen.w <= 0.0 || max(abs(seen.x), abs(seen.y)) >= seen.w) return 0.0;
    int columns = int(atlas_size.x);
    vec2 corner = atlas_size.y * vec2(map % columns, map / columns);
    vec2 within = clamp((0.5 * seen.xy / seen.w + 0.5) * atlas_size.y, 0.5, atlas_size.y - 0.5) - 0.5;
    vec2 first = min(floor(within), atlas_size.y - 2.0), share = within - first;
    vec4 stops = vec4(greaterThan(textureGather(atlas, (corner + first + 1.0) / atlas_size.zw), vec4(max(seen.z / seen.w, LEAST))));
    return mix(mix(stops.w, stops.z, share.x), mix(stops.x, stops.y, share.x), share.y);
}

// Whether a body's sphere can hide part of an emitter's.
bool may_hide(vec4 body, vec4 ball, vec3 from)
{
    vec3 to_body = body.xyz - from, to_light = ball.xyz - from;
    float squared = dot(to_body, to_body), far = length(to_light), along = dot(to_body, to_light) / far;
    if (squared <= body.w * body.w || isinf(ball.w)) return true;
    float sine = min(ball.w / far, STEEPEST), aside = sqrt(max(squared - along * along, 0.0));
    bool is_in_cone = aside * sqrt(1.0 - sine * sine) <= body.w + sine * max(along, 0.0);
    return is_in_cone && along >= -body.w && along <= far + ball.w + body.w;
}

// Bodies of a mask that can hide an emitter.
int hiding(int mask, vec4 ball, vec3 from)
{
    int result = 0;
    for (int i = 0; i < body_count; i++) {
        bool is_near = (mask >> (i % BITS) & 1) == 1;
        if (is_near && may_hide(texelFetch(bodies, i), ball, from)) result |= 1 << (i % BITS);
    }
    return result;
}

float hidden_by_all(int mask, int at_sample, vec3 from)
{
    float result = 0.0;
    for (int i = 0; i < body_count; i++)
        if ((mask >> (i % BITS) & 1) == 1) result = max(result, hidden(i, at_sample, from));
    return result;
}

// Illuminance by a sample of unit strength, and the direction towards it.
float arriving(int at_sample, vec3 from, vec3 N, out vec3 towards)
{
    vec4 place = texelFetch(samples, 2 * at_sample), axis = texelFetch(samples, 2 * at_sample + 1);
    vec3 way = place.xyz - place.w * from;
    float squared = max(dot(way, way), 1e-6);
    towards = way * inversesqrt(squared);
    float leaving = -dot(axis.xyz, towards);
    leaving = axis.w > 0.0 ? abs(leaving) : max(leaving, 0.0);
    float shines = dot(axis.xyz, axis.xyz) > 0.0 ? leaving : 1.0;
    return max(dot(N, towards), 0.0) * shines / (place.w > 0.0 ? squared : 1.0);
}

#ifdef IS_BASE
void main()
{
    frag_color = texelFetch(base_light, ivec2(gl_FragCoord.xy), 0);
}
#endif

#ifdef IS_SHADE
// What bodies take of one emitter's light.
void main()
{
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec4 range = texelFetch(emitters, 3 * emitter), ball = texelFetch(emitters, 3 * emitter + 1);
    float light = texelFetch(direct, ivec3(at, int(range.z)), 0).r;
    vec3 N = texelFetch(normals, at, 0).xyz;
    if (light <= 0.0 || dot(N, N) < 0.5) discard;
    vec3 from = texelFetch(places, at, 0).xyz;
    int mask = hiding(near_bodies, ball, from);
    if (mask == 0) discard;
    int nearest = findLSB(mask);

    float all = 0.0, taken = 0.0;
    int first = int(range.x), end = int(range.x + range.y);
    for (int i = first; i < end; i++) {
        vec3 towards;
        float strength = texelFetch(reach, (probe_count + nearest) * sample_count + i).r;
        float part = strength * arriving(i, from, N, towards);
        if (part <= 0.0) continue;
        all += part;
        taken += part * hidden_by_all(mask, i, from + CLEAR_M * towards);
    }
    if (taken <= 0.0) discard;
    for (int i = first_sibling; i < end_sibling; i++) {
        vec3 towards;
        if (i == emitter) continue;
        vec4 other = texelFetch(emitters, 3 * i);
        int other_end = int(other.x + other.y);
        for (int k = int(other.x); k < other_end; k++)
            all += texelFetch(reach, (probe_count + nearest) * sample_count + k).r * arriving(k, from, N, towards);
    }
    frag_color = vec4(largest * light * taken / all * texelFetch(emitters, 3 * emitter + 2).rgb, 0.0);
}
#endif

#ifdef IS_MOVER
// Share of light that a coat lets in (Born and Wolf, section 1.5).
float entering(float c, float eta)
{
    if (eta == 0.0) return 1.0;
    float inside = sqrt(1.0 - (1.0 - c * c) / (eta * eta));
    float across = (c - eta * inside) / (c + eta * inside), along = (inside - eta * c) / (inside + eta * c);
    return 1.0 - 0.5 * (across * across + along * along);
}

vec3 gathered(int probe, vec3 N)
{
    vec3 light = vec3(0.0);
    for (int i = 0; i < 3; i++)
        light += N[i] * N[i] * texelFetch(cubes, 6 * probe + (N[i] < 0.0 ? i + 3 : i)).rgb;
    return light;
}

void main()
{
    int point = texelFetch(mover_texel, ivec2(gl_FragCoord.xy), 0).r;
    if (point < 0) discard;
    vec4 place = texelFetch(points, 2 * point), normal = texelFetch(points, 2 * point + 1);
    vec3 N = normal.xyz, from = place.xyz + OWN_M * N;
    int probe = int(place.w), next = min(probe + 1, probe_count - 1);
    float share = place.w - float(probe);
    vec3 total = mix(gathered(probe, N), gathered(next, N), share);
    for (int e = 0; e < emitter_count; e++) {
        vec4 range = texelFetch(emitters, 3 * e), ball = texelFetch(emitters, 3 * e + 1);
        vec3 colour = texelFetch(emitters, 3 * e + 2).rgb;
        if (colour == vec3(0.0)) continue;
        int mask = hiding((1 << BITS) - 1, ball, from);
        int first = int(range.x), end = int(range.x + range.y);
        float light = 0.0;
        for (int i = first; i < end; i++) {
            vec3 towards;
            float part = arriving(i, place.xyz, N, towards);
            if (range.w >= 0.0) part = texelFetch(hard, int(range.w) * point_count + point).r;
            else {
                float near = texelFetch(reach, probe * sample_count + i).r;
                part *= mix(near, texelFetch(reach, next * sample_count + i).r, share);
                part *= entering(max(dot(N, towards), 0.0), normal.w);
            }
            if (part > 0.0) light += part * (1.0 - hidden_by_all(mask, i, from + OWN_M * towards));
        }
        total += light * colour;
    }
    frag_color = vec4(total, 1.0);
}
#endif
