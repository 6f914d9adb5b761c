// A surfel: what lies on its plane within its radius, as far away as that is.
#ifdef SOFT_EDGES
#include "soft_edges.glsl"
#endif
flat in vec2 middle;
flat in vec2 nearing;
flat in vec3 ellipse;
flat in vec3 depth;
flat in vec3 light;

out vec4 fragment;

bool within(vec2 at) {
    float part = 1.0 + dot(nearing, at);
    return part > 0.0 && dot(ellipse, vec3(at.x * at.x, at.x * at.y, at.y * at.y)) <= part * part;
}

void main() {
    vec2 at = gl_FragCoord.xy - middle;
#ifdef SOFT_EDGES
    for (int i = 0; i < 4; ++i) {
        if (!within(at + SAMPLES[i])) samples_shown &= ~(1 << i);
    }
    show_samples();
#else
    if (!within(at)) discard;
#endif
    gl_FragDepth = depth.x + depth.y * clamp(dot(nearing, at), -depth.z, depth.z);
#ifdef OVERDRAW
    fragment = vec4(vec3(OVERDRAW), 1.0);
#else
    fragment = vec4(light, 1.0);
#endif
}
