#version 410 core
#extension GL_ARB_shading_language_420pack : require
// Luminance of a surface's three channels, linear and unclipped: what its body scatters, what it mirrors, its glow.
#include <Pass>
#include <Batch>
layout(binding = 0) uniform sampler2D body_texture;
layout(binding = 1) uniform sampler2D light_texture;
layout(binding = 2) uniform sampler2DArray reflection;
layout(binding = 3) uniform sampler2D emission_texture;
layout(binding = 4) uniform samplerCube probe;

in vec2 at_texture;
in vec2 at_light;
in vec3 to_eye;
in vec3 facing;
flat in int layer;
in float before_mirror;
layout(location = 0, index = 0) out vec4 frag_color;
#ifdef IS_PANE
#ifndef IS_GREY
layout(location = 0, index = 1) out vec4 passes;
#endif
#endif

// What a grey surface does to light is one number; in a picture with one channel so is its light.
#ifdef IS_GREY
#define Shade float
#define SHADE(c) (c).r
#ifdef IS_MONO
#define Light float
#define LIGHT(c) dot(view.weights, c)
#else
#define Light vec3
#define LIGHT(c) (c)
#endif
#else
#define Shade vec3
#define SHADE(c) (c).rgb
#define Light vec3
#define LIGHT(c) (c)
#endif

const float PI = 3.14159265358979;
const float NARROWEST_RIM = 0.01;  // in opacity
const float LEAST_COVERED = 0.02;  // less of a sample is not drawn
const float SOLID = 0.98;  // more of a sample hides what is behind
const float LEAST_CLEAR = 1e-6;  // share of light that passes the fog

// Share of unpolarised light that a boundary from air to eta reflects (Born and Wolf, section 1.5), by one division.
float fresnel(float c, float eta, float inverse_square)
{
    float inside = sqrt(1.0 - (1.0 - c * c) * inverse_square);
    float across = c + eta * inside, along = inside + eta * c;
    float a = (c - eta * inside) * along, b = (inside - eta * c) * across;
    return 0.5 * (a * a + b * b) / max(across * across * along * along, 1e-36);  // 0 where eta is 1 and c is 0
}

const vec3 LUMINANCE = vec3(0.2126, 0.7152, 0.0722);

#ifdef HAS_PROBE
// What a probe shows along a ray, put right for where the ray starts in the room (Lagarde and Zanuttini, 2012).
vec3 probed(vec3 from, vec3 ray)
{
    from = clamp(from, view.probe_low, view.probe_high);
    ray = mix(ray, vec3(1e-9), equal(ray, vec3(0.0)));  // or 0 / 0, at the probe's bounds
    vec3 reach = max((view.probe_low - from) / ray, (view.probe_high - from) / ray);
    vec3 met = from + min(reach.x, min(reach.y, reach.z)) * ray;
    return view.probe_scale * textureLod(probe, met - view.probe_centre, batch.probe_level).rgb;
}

// The lamps that the probe does not show, as rough facets mirror them (GGX; Heitz 2014). Where less light arrives than
// all of them would give, something hides some of them. F is taken out again: facets are not seen as N is.
vec3 glint(vec3 from, vec3 N, vec3 V, float arrives, float F)
{
    float root = (batch.eta - 1.0) / (batch.eta + 1.0), normal = root * root, inverse_f = 1.0 / max(F, 1e-4);
    vec3 light = vec3(0.0);
    float cv = max(dot(N, V), 0.01), unhidden = 1e-9, alpha = batch.roughness + 0.0025;
    for (int i = 0; i < int(view.glint_count); i++) {
        vec4 place = view.glints[4 * i], power = view.glints[4 * i + 1], axis = view.glints[4 * i + 2];
        vec4 size = view.glints[4 * i + 3];
        vec3 way = place.xyz - place.w * from;
        float inverse_square = 1.0 / dot(way, way);
        vec3 L = sqrt(inverse_square) * way;
        float cl = dot(N, L);
        if (cl <= 0.0) continue;
        float edge = 1.0;
        if (axis.w < 0.0) edge = max(-dot(L, axis.xyz), 0.0);
        else if (power.w < PI) edge = clamp((power.w - acos(clamp(-dot(L, axis.xyz), -1.0, 1.0))) * axis.w, 0.0, 1.0);
        vec3 square_on = mix(1.0, inverse_square, place.w) * edge * power.rgb;
        unhidden += cl * dot(LUMINANCE, square_on);
        // A lamp widens the lobe by its size; facets turn by half as much (Karis 2013).
        float squared = alpha * alpha + 0.25 * size.x * size.x * inverse_square;
        float doubled = max(1.0 + dot(V, L), 1e-6), squared_h = 0.5 * (cl + cv) * (cl + cv) / doubled;
        float peak = squared_h * (squared - 1.0) + 1.0;
        // What a facet mirrors (Schlick 1994), in units of F, which is that of N.
        float away = 1.0 - sqrt(0.5 * doubled), away2 = away * away;
        float facet = mix((normal + (1.0 - normal) * away2 * away2 * away) * inverse_f, 1.0, batch.metal);
        facet *= mix(1.0, batch.area_glint_share, size.y);
        light += facet * cl * squared / (peak * peak * mix(2.0 * cl * cv, cl + cv, alpha)) * square_on;
    }
    return 0.5 / PI * smoothstep(0.2, 1.0, PI * arrives / unhidden) * light;
}
#endif

void main()
{
    // What is interpolated over a triangle seen edge-on is undefined: its area is zero in floating point.
    if (isnan(to_eye.x)) discard;
#ifdef IS_MIRRORED
    // Not clipped by OpenGL, which would move the ends of edges that must stay the same from mirror to mirror.
    if (before_mirror < 0.0) discard;
#endif
#ifdef HAS_FOG
    float clear = exp(-view.extinction * length(to_eye));  // share of light that passes the fog (Koschmieder, 1924)
#endif
    Shade colour = SHADE(batch.colour);
#ifdef HAS_TEXTURE
    vec4 texel = texture(body_texture, at_texture, view.lod_bias[layer]);
    colour *= SHADE(texel);
#ifdef HAS_CUTOUT
    // Half of the rim is covered: there opacity is what a ray takes for the edge; the rim is a pixel wide.
    float rim = clamp(batch.cutout, NARROWEST_RIM, 1.0 - NARROWEST_RIM);
    float widest = 2.0 * min(rim, 1.0 - rim);
    float width = clamp(fwidth(texel.a), NARROWEST_RIM, widest);
    float covered = clamp((texel.a - rim) / width + 0.5, 0.0, 1.0);
#ifdef IS_RIM
    if (covered < LEAST_COVERED || covered >= SOLID) discard;
#else
#ifdef IS_SOLID
    if (covered < SOLID) discard;
#else
    if (texel.a < batch.cutout) discard;
#endif
#endif
#endif
#endif
#ifdef HAS_LIGHT
    vec3 around = textureLod(light_texture, at_light, 0.0).rgb / PI;
    Light light = LIGHT(around);
#endif
#ifdef HAS_GLOSS
#ifdef IS_PLANAR
    float above = dot(batch.plane, vec4(view.eye, 1.0)), c = clamp(abs(above) / length(to_eye), 0.0, 1.0);
    vec3 N = sign(above) * batch.plane.xyz;
#else
    float above = dot(facing, to_eye), c = clamp(abs(above) / (length(facing) * length(to_eye)), 0.0, 1.0);
    vec3 N = sign(above) * normalize(facing);
#endif
    float F = batch.grazing_exponent > 0.0 ? batch.normal_reflectance + batch.grazing_rise * pow(1.0 - c, batch.grazing_exponent)
                                           : fresnel(c, batch.eta, batch.inverse_eta_squared);
#ifdef HAS_REFLECTION
    vec3 seen = texelFetch(reflection, ivec3(ivec2(gl_FragCoord.xy), layer), 0).rgb;
#ifdef IS_MONO
    seen = vec3(view.inverse_weight_sum * seen.r);  // which has been weighted
#endif
#ifdef HAS_FOG
    // It was drawn with the fog of the whole path. The part between the mirror and the eye is added at the end.
    seen = (seen - (1.0 - clear) * view.airlight) / max(clear, LEAST_CLEAR);
#endif
#else
    vec3 seen = view.ambient;
    float arrives = 1e9;
#ifndef IS_LAST
#ifdef HAS_LIGHT
    seen = batch.arriving_over_entering * around;  // as bright as what lights the place
    arrives = dot(LUMINANCE, seen);
#endif
#endif
#ifdef HAS_PROBE
    vec3 from = view.eye - to_eye, V = normalize(to_eye);
    // Where less light arrives than at the probe, something hides what the probe sees.
    float most = max(view.probe_mean + dot(view.probe_gradient, N), 0.05 * view.probe_mean);
    float open = min(1.0, arrives / (most * dot(LUMINANCE, view.probe_scale)));
    seen = mix(seen, open * probed(from, reflect(-V, N)) + glint(from, N, V, arrives, F), batch.probe_share);
#endif
#endif
    Light mirrored = LIGHT(seen);
#endif
#ifdef IS_PANE
    // All reflections between the pane's two faces added.
    F = 2.0 * F / (1.0 + F);
    Light radiance = F * mirrored;
    Shade through = (1.0 - F) * colour;
#else
#ifdef IS_MIRROR
    Light radiance = colour * mirrored;
#else
#ifdef HAS_GLOSS
    Shade body = colour, mirrors = Shade(batch.tint * F);
#ifdef HAS_METAL
    float metal = batch.metal, away = 1.0 - c, grazing = batch.metal_rise * away * away * away * away * away;
    body *= 1.0 - metal;
    mirrors = (1.0 - metal) * mirrors + metal * (colour + (1.0 - colour) * grazing);
#endif
    body *= batch.inverse_eta_squared * (1.0 - F) / (1.0 - body * batch.inner_reflectance);
    Light radiance = body * light + mirrors * mirrored;
#else
    Light radiance = colour * light;
#endif
#endif
#endif
#ifdef HAS_EMISSION
    vec3 glow = batch.emission;
#ifdef HAS_EMISSION_TEXTURE
    glow *= texture(emission_texture, batch.emission_repeats * at_texture, view.lod_bias[layer]).rgb;
#endif
#ifdef IS_LAMP
    radiance = LIGHT(glow * around);
#else
    radiance += LIGHT(glow);
#endif
#endif
#ifdef HAS_FOG
    Light air = (1.0 - clear) * LIGHT(view.airlight);
#ifdef IS_PANE
    // What is seen through the pane has the fog of its whole path already.
    radiance = clear * radiance + (1.0 - through) * air;
#else
    radiance = clear * radiance + air;
#endif
#endif
#ifdef IS_MONO
#ifdef IS_GREY
    frag_color = vec4(radiance, 0.0, 0.0, 1.0);
#else
    frag_color = vec4(dot(view.weights, radiance), 0.0, 0.0, 1.0);
#endif
#else
    frag_color = vec4(radiance, 1.0);
#endif
#ifdef IS_RIM
    frag_color.a = covered;
#endif
#ifdef IS_PANE
#ifdef IS_GREY
    frag_color.a = through;
#else
    passes = vec4(through, 1.0);
#endif
#endif
}
