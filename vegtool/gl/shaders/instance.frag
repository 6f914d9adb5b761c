// What a camera sees of one of many plants: linear light.
#ifdef VERTEX_LIT
in vec3 front_light;
in vec3 back_light;
in vec2 uv;
#else
#include "material.glsl"
#ifndef UNLIT
#include "lit.glsl"
#endif

in vec3 position;
in vec3 normal;
in vec2 uv;
in vec4 vertex_color;
in vec2 exposure;
#endif
#ifdef REVEAL
#include "reveal.glsl"
#endif

out vec4 fragment;

void main() {
#ifdef VERTEX_LIT
#ifdef REVEAL
    reveal(noise_here());
#endif
#ifdef OVERDRAW
    fragment = vec4(vec3(OVERDRAW), 1.0);
#else
    fragment = vec4(gl_FrontFacing ? front_light : back_light, 1.0);
#endif
#else
    vec3 color = surface_color(uv, vertex_color);
#ifdef REVEAL
#ifdef DITHERED
    reveal(noise_here());
#else
    reveal(noise_at(uv, color_map));
#endif
#endif
#ifdef PAINTED
    color = vertex_color.rgb;
#endif
#ifdef OVERDRAW
    fragment = vec4(vec3(OVERDRAW), 1.0);
    return;
#endif
#ifndef UNLIT
    vec3 n = surface_normal(normal, position, uv);
    color = lit(surface(color, turned(n, gl_FrontFacing), exposure, uv, gl_FrontFacing), position);
#endif
#ifdef SOFT_EDGES
    show_samples();
#endif
    fragment = vec4(color, 1.0);
#endif
}
