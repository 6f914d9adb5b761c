// Which patch of triangles is seen, and where.
#include "material.glsl"

in vec3 place;
flat in float number;
in vec3 normal;
in vec2 uv;
in vec4 vertex_color;

layout(location = 0) out vec4 out_plane;    // the place; which arc, from -1 down
layout(location = 1) out vec4 out_surface;  // the same; all is covered

void main() {
    surface_color(uv, vertex_color);
    out_plane = vec4(place, -number - 1.0);
    out_surface = vec4(place, 1.0);
}
