#version 330 core
// Luminance of a diffuse surface: reflectance times illuminance over pi, linear and unclipped.
struct Material {
    sampler2D base_color_texture;
    sampler2D emissive_texture;
};
uniform Material material;

in vec2 uv_albedo;
in vec2 uv_light;
out vec4 frag_color;

const float PI = 3.14159265358979;
// Four samples a pixel are averaged later, so that each may look one mipmap level finer.
const float SUPERSAMPLED_LOD_BIAS = -1.0;

void main()
{
    float albedo = texture(material.base_color_texture, uv_albedo, SUPERSAMPLED_LOD_BIAS).r;
    float illuminance = textureLod(material.emissive_texture, uv_light, 0.0).r;
    frag_color = vec4(albedo * illuminance / PI, 0.0, 0.0, 1.0);
}
