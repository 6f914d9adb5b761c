// Two pictures and how much they differ, side by side; linear light.
#include "linear.glsl"

uniform sampler2D first;
uniform sampler2D second;
uniform int width;  // pixels, of each

out vec4 fragment;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    int panel = min(at.x / width, 2);
    ivec2 place = ivec2(at.x - panel * width, at.y);
    vec3 a = texelFetch(first, place, 0).rgb, b = texelFetch(second, place, 0).rgb;
    vec3 shown = panel == 0 ? a : panel == 1 ? b : abs(a - b);
    fragment = vec4(linear_from_srgb(shown), 1.0);
}
