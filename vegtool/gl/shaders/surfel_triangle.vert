// A corner of a patch of triangles of one of many plants; of one that is not drawn, no place at all.
// Fragments are those of other plants (instance.frag).
#include "surfel_steps.glsl"
#include "surfel_place.glsl"

#ifdef EXPOSURE
const int TEXELS = 4;  // per vertex
#else
const int TEXELS = 3;
#endif

uniform sampler2D vertices;  // as of PlantBuffers
#ifdef PAINTED
uniform vec3 paint;
#endif

in ivec4 in_corner;  // vertex, steps below and above, arc

#ifdef READ
out vec3 place;
flat out float number;
#endif
out vec3 position;
out vec3 normal;
out vec2 uv;
out vec4 vertex_color;
out vec2 exposure;

vec4 texel(int vertex, int part) {
    int per_row = textureSize(vertices, 0).x / TEXELS;
    return texelFetch(vertices, ivec2(TEXELS * (vertex % per_row) + part, vertex / per_row), 0);
}

void main() {
    gl_Position = NOWHERE;
    position = normal = vec3(0.0);
    uv = vec2(0.0);
    vertex_color = vec4(1.0);
    exposure = vec2(1.0);
#ifdef READ
    place = vec3(0.0);
    number = 0.0;
#endif
    if (!let_through(in_corner.y, in_corner.z, in_eye)) return;
    vec4 position_u = texel(in_corner.x, 0), normal_v = texel(in_corner.x, 1);
    position = placed(position_u.xyz);
    normal = turned_about_y(normal_v.xyz);
    uv = vec2(position_u.w, normal_v.w);
    vertex_color = texel(in_corner.x, 2);
#ifdef PAINTED
    vertex_color.rgb = paint;
#endif
#ifdef EXPOSURE
    exposure = texel(in_corner.x, 3).xy;
#endif
#ifdef READ
    place = position_u.xyz;
    number = float(in_corner.w);
#endif
    gl_Position = view_projection * vec4(position, 1.0);
}
