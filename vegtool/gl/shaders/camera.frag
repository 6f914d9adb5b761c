// What a camera sees: linear light, premultiplied by coverage.
#include "material.glsl"
#ifndef UNLIT
#include "lit.glsl"
#endif

in vec3 position;
in vec3 normal;
in vec2 uv;
in vec4 vertex_color;
in vec2 exposure;

out vec4 fragment;

void main() {
    vec3 color = surface_color(uv, vertex_color);
#ifndef UNLIT
    vec3 n = surface_normal(normal, position, uv);
    color = lit(surface(color, turned(n, gl_FrontFacing), exposure, uv, gl_FrontFacing), position);
#endif
    fragment = vec4(color, 1.0);
}
