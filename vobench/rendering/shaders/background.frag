#version 410 core
#extension GL_ARB_shading_language_420pack : require
// Luminance of a sky and of the ground below the horizon. Source: ISO 15469:2004, eqs 1 to 7.
uniform vec4 gradation;  // coefficients a and b, luminance per relative luminance, luminance of the ground
uniform vec4 scatter;    // coefficients c, d and e, and the scatter square to the sun
uniform vec4 sun;        // direction
uniform vec4 colour;     // of all of it; in a picture with one channel times the weights
in vec3 ray;
out vec4 frag_color;

void main()
{
    vec3 direction = normalize(ray);
    float towards = clamp(dot(direction, sun.xyz), -1.0, 1.0);
    float indicatrix = 1.0 + scatter.z * towards * towards;
    if (scatter.x != 0.0) indicatrix += scatter.x * (exp(scatter.y * acos(towards)) - scatter.w);
    float sky = gradation.z * indicatrix * (1.0 + gradation.x * exp(gradation.y / max(direction.z, 1e-3)));
    frag_color = (direction.z < 0.0 ? gradation.w : sky) * colour;
}
