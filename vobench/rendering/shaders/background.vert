#version 410 core
#extension GL_ARB_shader_viewport_layer_array : require
// One triangle over the whole picture, behind everything; the ray through each of its points in the world.
uniform mat3 world_from_screen;
out vec3 ray;

void main()
{
    vec2 at = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2) * 2.0 - 1.0;
    gl_Position = vec4(at, 0.0, 1.0);
    gl_Layer = gl_InstanceID;
    gl_ViewportIndex = gl_InstanceID;
    ray = world_from_screen * vec3(at, 1.0);
}
