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
// Each pixel is the mean of 2 x 2 samples, so that each may look one mipmap level finer.
const float SUPERSAMPLED_LOD_SCALE = 0.5;

// Steps, in samples, that turn the 2 x 2 grid so that its samples lie in four rows and four columns:
// an edge along a row or column of pixels then falls between them to an eighth of a pixel, not a quarter.
vec2 turned_grid()
{
    vec2 odd = mod(floor(gl_FragCoord.xy), 2.0) * 2.0 - 1.0;
    return 0.25 * vec2(-odd.y, odd.x);
}

void main()
{
    vec2 right = dFdx(uv_albedo), up = dFdy(uv_albedo);
    vec2 uv = uv_albedo + mat2(right, up) * turned_grid();
    float albedo = textureGrad(
        material.base_color_texture, uv, SUPERSAMPLED_LOD_SCALE * right, SUPERSAMPLED_LOD_SCALE * up).r;
    float illuminance = textureLod(material.emissive_texture, uv_light, 0.0).r;
    frag_color = vec4(albedo * illuminance / PI, 0.0, 0.0, 1.0);
}
