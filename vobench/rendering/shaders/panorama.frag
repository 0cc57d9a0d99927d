#version 410 core
#extension GL_ARB_shading_language_420pack : require
// Luminance of a panorama in the cylindrical equal-area projection; see `PanoramaMap`.
layout(binding = 5) uniform sampler2D panorama;
uniform float illuminance_lx;  // by the sky
uniform float lamp_share;      // how many of the lamps are on
uniform vec4 weights;          // of the channels in a picture that has one
in vec3 ray;
out vec4 frag_color;

const float TURN = 6.28318530717959;
const float SAMPLE_PX = 0.5;   // four samples share a pixel
const vec3 LAMP = vec3(1.25, 0.96, 0.62);  // the hue of lamps, of luminance 1

// The step on the map that goes with a step of the direction; from differences of places, it would leap at the seam.
vec2 map_step(vec3 direction, vec3 step)
{
    float squared = max(dot(direction.xy, direction.xy), 1e-6);
    float turn = (direction.x * step.y - direction.y * step.x) / squared;
    return SAMPLE_PX * vec2(turn / TURN, -0.5 * step.z);
}

void main()
{
    vec3 direction = normalize(ray);
    vec2 place = vec2(atan(direction.y, direction.x) / TURN + 0.5, 0.5 - 0.5 * direction.z);
    vec2 across = map_step(direction, dFdx(direction)), down = map_step(direction, dFdy(direction));
    vec4 texel = textureGrad(panorama, place, across, down);
    vec3 seen = illuminance_lx * texel.rgb + lamp_share * texel.a * LAMP;
#ifdef IS_MONO
    frag_color = vec4(dot(weights.rgb, seen), 0.0, 0.0, 1.0);
#else
    frag_color = vec4(seen, 1.0);
#endif
}
