#version 410 core
#extension GL_ARB_shading_language_420pack : require
#extension GL_ARB_shader_viewport_layer_array : require
// Where a surface's corners fall in each sample's layer; texture and light coordinates pass through.
layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;
layout(location = 2) in vec2 uv_texture;
layout(location = 3) in vec2 uv_light;

#include <Pass>
#include <Batch>

// Surfaces that meet are drawn by several programs; each puts a corner in the same place, so that no gap opens.
invariant gl_Position;
out vec2 at_texture;
out vec2 at_light;
out vec3 to_eye;
out vec3 facing;
flat out int layer;
out float before_mirror;

const float TOUCHING_M = 1e-5;

// How far a point is above a plane, 0 where it lies in it.
float height(vec4 plane, vec3 point)
{
    float distance = dot(plane.xyz, point) + plane.w;
    return abs(distance) < TOUCHING_M ? 0.0 : distance;
}

void main()
{
    vec4 world = batch.model * vec4(position, 1.0);
    // Mirror by mirror, so that what touches a mirror lands on its own image to the last bit, and leaves no gap.
    vec3 image = world.xyz;
    for (int i = 2; i >= 0; i--) image -= 2.0 * height(view.mirrors[i], image) * view.mirrors[i].xyz;
    gl_Position = view.direct * vec4(image, 1.0);
    before_mirror = dot(view.clip_plane, world);
    gl_Layer = gl_InstanceID;
    gl_ViewportIndex = gl_InstanceID;
    layer = gl_InstanceID;
    at_texture = uv_texture;
    at_light = uv_light;
    to_eye = view.eye - world.xyz;
    facing = mat3(batch.model) * normal;
}
