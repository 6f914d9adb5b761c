// What is not cut away, for its depth alone.
#include "material.glsl"

in vec2 uv;
in vec4 vertex_color;

void main() {
    surface_color(uv, vertex_color);
}
