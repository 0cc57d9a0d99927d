#version 410 core
#extension GL_ARB_shading_language_420pack : require
// Luminance of a surface, linear and unclipped: what its body scatters and what it mirrors.
layout(std140, binding = 0) uniform Pass {
    mat4 view_projection;
    vec4 eye;
    vec4 clip_plane;
    vec4 lod_bias;
    mat4 direct;
    vec4 mirrors[3];
};
layout(binding = 0) uniform sampler2D body_texture;
layout(binding = 1) uniform sampler2D light_texture;
uniform float body_scale;  // of the body's texture, over pi
uniform float eta;
uniform float tint;
uniform float eye_height;  // distance of the eye from the mirroring plane
#ifdef HAS_REFLECTION
layout(binding = 2) uniform sampler2DArray reflection;
#endif
#ifdef HAS_ROUGHNESS
layout(binding = 3) uniform sampler2D rough_reflection;
#endif

in vec2 uv_albedo;
in vec2 uv_light;
in vec3 to_eye;
flat in int layer;
#ifdef IS_MIRRORED
in float before_mirror;
#endif
out vec4 frag_color;

// Share of unpolarised light that a boundary from air to eta reflects (Born and Wolf, section 1.5).
float fresnel(float c)
{
    float inside = sqrt(1.0 - (1.0 - c * c) / (eta * eta));
    float across = (c - eta * inside) / (c + eta * inside);
    float along = (inside - eta * c) / (inside + eta * c);
    return 0.5 * (across * across + along * along);
}

void main()
{
#ifdef IS_MIRRORED
    // Not clipped by OpenGL, which would move the ends of edges that must stay the same from mirror to mirror.
    if (before_mirror < 0.0) discard;
#endif
    float luminance = 0.0, passes = 1.0, mirrored = 0.0;
#ifdef HAS_FRESNEL
    float F = fresnel(clamp(eye_height / length(to_eye), 0.0, 1.0));
#else
    float F = 1.0;
#endif
#ifdef HAS_REFLECTION
    mirrored = F * texelFetch(reflection, ivec3(ivec2(gl_FragCoord.xy), layer), 0).r;
#else
    mirrored = F * eye.w;
#endif
#ifdef HAS_ROUGHNESS
    // Pixels whose middle is beside the mirror have none.
    float spread = texelFetch(rough_reflection, ivec2(gl_FragCoord.xy), 0).r;
    mirrored = spread < 0.0 ? mirrored : spread;
#endif
#ifdef HAS_BODY
    float albedo = body_scale * texture(body_texture, uv_albedo, lod_bias[layer]).r;
    luminance = albedo * textureLod(light_texture, uv_light, 0.0).r;
#ifdef HAS_FRESNEL
    luminance *= 1.0 - F;
#endif
    luminance += tint * mirrored;
#else
#ifdef IS_PANE
    // All reflections between the pane's two faces added.
    luminance = 2.0 / (1.0 + F) * mirrored;
    passes = (1.0 - 2.0 * F / (1.0 + F)) * tint;
#else
    luminance = tint * mirrored;
#endif
#endif
    frag_color = vec4(luminance, 0.0, 0.0, passes);
}
