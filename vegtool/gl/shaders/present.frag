// Samples to pixels of a frame: their mean in linear light, as sRGB.
#include "srgb.glsl"

uniform sampler2DMS drawn;
uniform int samples;

out vec4 pixel;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec3 total = vec3(0.0);
    for (int i = 0; i < samples; ++i) total += texelFetch(drawn, at, i).rgb;
    pixel = vec4(srgb_from_linear(clamp(total / float(samples), 0.0, 1.0)), 1.0);
}
