// What a surfel billboard shows: cut out by an alpha test, lit by its normals, and as far away as the
// surface that it is a picture of.
#ifndef UNLIT
#include "lit.glsl"
#endif
#ifdef SOFT_EDGES
#include "soft_edges.glsl"
#endif

// Alpha is such that as much passes as is covered (surfels/coverage.py).
const float CUTOFF = 0.5;

// Neither has mips: a texel covers epsilon pixels where a billboard is first drawn, and by the time
// that it is much smaller, its father is drawn. Only what has no father shrinks further, and that
// is a few pixels by then.
uniform sampler2D color_atlas;
uniform sampler2D surface_atlas;  // normal, signed depth

in vec2 uv;
in vec2 plane;
flat in vec2 depth;
flat in mat3 frame;
flat in vec3 paint;
#ifdef READ
in vec3 position;
flat in vec3 deep;
flat in float number;

layout(location = 0) out vec4 out_plane;    // the place on the plane; which billboard, from 1 on
layout(location = 1) out vec4 out_surface;  // the place on the surface; how much is covered
#else
out vec4 fragment;
#endif

void main() {
    vec4 color = texture(color_atlas, uv);
    vec4 surface_texel = texture(surface_atlas, uv) * 255.0 - 128.0;
    float raised = surface_texel.w / 127.0;
#ifdef SOFT_EDGES
    cover(color.a, CUTOFF);
    show_samples();
#else
    if (color.a < CUTOFF) discard;
#endif
    vec2 zw = plane + raised * depth;
    gl_FragDepth = 0.5 + 0.5 * zw.x / zw.y;
#if defined(READ)
    out_plane = vec4(position, number + 1.0);
    out_surface = vec4(position + raised * deep, color.a);
#elif defined(OVERDRAW)
    fragment = vec4(vec3(OVERDRAW), 1.0);
#else
#ifdef PAINTED
    color.rgb = paint;
#endif
#ifndef UNLIT
    vec3 n = frame * surface_texel.xyz;
    n /= max(length(n), 1e-12);
    color.rgb = lit(Surface(color.rgb, n, vec2(1.0), 0.0, vec3(1.0)), vec3(0.0));
#endif
    fragment = vec4(color.rgb, 1.0);
#endif
}
