// One sample of a picture: colour with gamma 2 (10 bits are then finer than 8 bits of sRGB); normal,
// or with LIT the light that falls on it in the colour instead, but for UNLIT ones; with LIGHT what is baked of light.
// Alpha marks that a surface is there. Depth is the depth buffer's.
#include "material.glsl"
#if defined(LIT) || defined(LIGHT)
#include "lit.glsl"
#endif

in vec3 v_position;
in vec3 v_normal;
in vec2 v_uv;
in vec4 v_color;
in vec3 v_place;
in vec2 v_exposure;
flat in mat3 v_frame;

uniform float side;

layout(location = 0) out vec4 out_color;
#ifndef LIT
layout(location = 1) out vec4 out_normal;
#endif
#ifdef LIGHT
layout(location = 2) out vec4 out_light;
#endif

#ifdef LIT
uniform bool both_sides;  // one picture for both: the mean of their light

vec3 lit_picture(Surface s) {
    vec3 light = lit(s, v_place);
    if (!both_sides) return light;
    return 0.5 * (light + lit(Surface(s.color, -s.normal, s.exposure.yx, s.transmission, s.tint), v_place));
}
#endif

void main() {
    vec3 color = surface_color(v_uv, v_color);
    vec3 normal = surface_normal(v_normal, v_position * vec3(1.0, 1.0, side), v_uv);
    if (!gl_FrontFacing) normal = -normal;  // glTF: a back face's normal is reversed
    // Shading normals may still point away, those of a crown do on half of its leaves. Blue is
    // below one half there: what glTF advises against, clients show, and light is wrong without.
    if (dot(normal, normal) < 1e-6) normal = vec3(0.0, 0.0, 1.0);
    normal = unit(normal);
#if defined(LIT) || defined(LIGHT)
    vec3 placed = v_frame * vec3(normal.xy, normal.z * side);
    Surface s = surface(color, placed, v_exposure, v_uv, gl_FrontFacing);
#endif
#if defined(LIT) && !defined(UNLIT)
    color = min(lit_picture(s), 1.0);
#endif
#ifndef LIT
    out_normal = vec4((normal * 511.0 + 512.0) / 1023.0, 1.0);
#endif
#ifdef LIGHT
    out_light = vec4(s.exposure, 0.0, s.transmission);
#endif
    out_color = vec4(sqrt(color), 1.0);
}
