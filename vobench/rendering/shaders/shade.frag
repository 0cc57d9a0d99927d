#version 410 core
// Light at one texel of the map.
in vec3 light;
out vec4 frag_color;

void main()
{
    frag_color = vec4(light, 0.0);
}
