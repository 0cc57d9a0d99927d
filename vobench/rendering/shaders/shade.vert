#version 410 core
#extension GL_ARB_shading_language_420pack : require
// Texels of the light map as points: what moving bodies take of an emitter's light there, or what it gives a body.
#include <Shade>
layout(binding = 0) uniform sampler2D atlas;  // nearness of bodies, seen from samples of emitters
layout(location = 0) in vec3 place;
layout(location = 1) in vec4 normal;   // and the logarithm of all steady light there; on movers eta of the coat
layout(location = 2) in vec2 texel;
layout(location = 3) in float direct;  // illuminance by the emitter, in a unit; on movers by its hard light
layout(location = 4) in float probe;   // on movers: between which two of the probes it lies; else its width in texels
out vec3 light;

const float CLEAR_M = 0.004;  // towards the light, from where a stationary place looks for bodies
const float OWN_M = 0.025;     // the same from a body, whose map shows it coarsely
const int LAST_BIT = 30;
const float STEEPEST = 0.999;
const float UNNOTICED = 1.0 / 400.0;  // share of the light, above which some of it that is taken shows
const float STEPS_PER_OCTAVE = 6.0;   // of all steady light
const float NEAR_M = 0.05;    // nearness in a map is this over the distance
const float LEAST = 1e-6;     // nearness of what lies farther than a map shows

// Share of a place that a body hides from a sample.
float hidden(int body, int at_sample, vec3 from)
{
    int number = body * int(shade.sample_count) + at_sample;
    vec4 world = vec4(from, 1.0), tile = shade.tiles[number];
    if (tile.z == 0.0) return 0.0;
    float along = dot(shade.maps[3 * number + 2], world);
    float near = shade.places[at_sample].w, w = near > 0.0 ? along : 1.0;
    vec2 seen = vec2(dot(shade.maps[3 * number], world), dot(shade.maps[3 * number + 1], world));
    if (w <= 0.0 || max(abs(seen.x), abs(seen.y)) >= w) return 0.0;
    vec2 within = clamp((0.5 * seen / w + 0.5) * shade.tile_px, 0.5, shade.tile_px - 0.5) - 0.5;
    vec2 first = min(floor(within), shade.tile_px - 2.0), share = within - first;
    vec4 nearness = textureGather(atlas, (tile.xy + first + 1.0) / shade.size_px.xy);
    vec4 stops = vec4(greaterThan(nearness, vec4(max(near > 0.0 ? NEAR_M / w : along, LEAST))));
    return mix(mix(stops.w, stops.z, share.x), mix(stops.x, stops.y, share.x), share.y);
}

// Whether a body's sphere can hide part of the emitter.
bool may_hide(vec4 body, vec3 from)
{
    vec3 to_body = body.xyz - from, to_light = shade.ball.xyz - from;
    float squared = dot(to_body, to_body), far = length(to_light), along = dot(to_body, to_light) / far;
    if (squared <= body.w * body.w || shade.ball.w < 0.0) return true;
    float sine = min(shade.ball.w / far, STEEPEST), aside = sqrt(max(squared - along * along, 0.0));
    bool is_in_cone = aside * sqrt(1.0 - sine * sine) <= body.w + sine * max(along, 0.0);
    return is_in_cone && along >= -body.w && along <= far + shade.ball.w + body.w;
}

// The bodies, as bits, of which a part may hide the emitter; the last bit stands for many, -1 for all.
int hiding(vec3 from)
{
    int mask = 0;
    for (int i = 0; i < int(shade.sphere_count); i++) {
        int body = int(shade.sphere_bodies[i].x);
        if (may_hide(shade.spheres[i], from)) mask |= body < 0 ? -1 : 1 << min(body, LAST_BIT);
    }
    return mask;
}

// The body that hides most of the light of a sample decides: bodies behind one another hide the same.
float hidden_by_all(int mask, int at_sample, vec3 from)
{
    float result = 0.0;
    for (int i = 0; i < int(shade.body_count); i++)
        if ((mask >> min(i, LAST_BIT) & 1) == 1 && result < 1.0) result = max(result, hidden(i, at_sample, from));
    return result;
}

// Illuminance by a sample of unit strength, and the direction towards it.
float arriving(int at_sample, vec3 from, vec3 N, out vec3 towards)
{
    vec4 from_sample = shade.places[at_sample], axis = shade.axes[at_sample];
    vec3 way = from_sample.xyz - from_sample.w * from;
    float squared = max(dot(way, way), 1e-6);
    towards = way * inversesqrt(squared);
    float leaving = -dot(axis.xyz, towards);
    leaving = axis.w > 0.0 ? abs(leaving) : max(leaving, 0.0);
    float shines = dot(axis.xyz, axis.xyz) > 0.0 ? leaving : 1.0;
    return max(dot(N, towards), 0.0) * shines / (from_sample.w > 0.0 ? squared : 1.0);
}

// Share of light that a coat lets in (Born and Wolf, section 1.5).
float entering(float c, float eta)
{
    if (eta == 0.0) return 1.0;
    float inside = sqrt(1.0 - (1.0 - c * c) / (eta * eta));
    float across = (c - eta * inside) / (c + eta * inside), along = (inside - eta * c) / (inside + eta * c);
    return 1.0 - 0.5 * (across * across + along * along);
}

#ifdef IS_MOVER
float strength(int at_sample)
{
    int first = int(probe), next = min(first + 1, int(shade.probe_count) - 1);
    int one_at = first * int(shade.sample_count) + at_sample, other_at = next * int(shade.sample_count) + at_sample;
    float one = shade.reach[one_at / 4][one_at % 4], other = shade.reach[other_at / 4][other_at % 4];
    return mix(one, other, probe - float(first));
}

// What falls on a body.
float shown()
{
    float total = 0.0;
    bool is_behind = shade.ball.w >= 0.0 && dot(normal.xyz, shade.ball.xyz - place) <= -shade.ball.w;
    if (is_behind) return 0.0;
    int mask = hiding(place);
    for (int i = 0; i < int(shade.sample_count); i++) {
        vec3 towards;
        float part = arriving(i, place, normal.xyz, towards);
        part = shade.is_hard > 0.0 ? direct : part * strength(i) * entering(max(dot(normal.xyz, towards), 0.0), normal.w);
        if (part > 0.0) total += part * (1.0 - hidden_by_all(mask, i, place + OWN_M * (normal.xyz + towards)));
    }
    return total;
}
#else
// What bodies take.
float shown()
{
    int mask = direct > 0.0 ? hiding(place) : 0;
    if (mask == 0) return 0.0;
    float all = 0.0, taken = 0.0;
    for (int i = 0; i < int(shade.sample_count); i++) {
        vec3 towards;
        float part = shade.strengths[i].x * arriving(i, place, normal.xyz, towards);
        all += part;
        if (part > 0.0) taken += part * hidden_by_all(mask, i, place + CLEAR_M * towards);
    }
    float light = taken > 0.0 ? shade.unit_lx * direct * taken / all : 0.0;
    float steady = exp2(127.0 / STEPS_PER_OCTAVE * normal.w) - 1.0;
    return light > UNNOTICED * (steady + light) ? light : 0.0;
}
#endif

#ifdef IS_GIVEN
layout(location = 5) in vec3 given;
#endif

void main()
{
#ifdef IS_GIVEN
    light = given;
#else
    light = shown() * shade.colour;
#endif
    bool is_any = max(light.r, max(light.g, light.b)) > 0.0;
    // Points outside the map are not drawn.
#ifdef IS_SHADE
    float width = probe;
#else
    float width = 1.0;
#endif
    gl_PointSize = width;
    gl_Position = is_any ? vec4(2.0 * (texel + 0.5 * width) / shade.size_px.zw - 1.0, 0.0, 1.0) : vec4(2.0, 2.0, 2.0, 1.0);
}
