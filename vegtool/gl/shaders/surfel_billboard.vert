// A corner of a surfel billboard of one of many plants; of one that is not drawn, no place at all.
// What is seen from behind is the picture of the back, or that of the front, or nothing.
#include "surfel_steps.glsl"
#include "surfel_place.glsl"

const int TEXELS = 6;  // of a billboard, see gl/surfel_data.py
const float ONE_SIDED = 0.0, DIFFERENT = 2.0;

uniform sampler2D quads;
uniform vec2 atlas_size;  // texels
#ifdef PAINTED
uniform vec3 palette[PAINTED];
#endif

out vec2 uv;
out vec2 plane;        // z and w of the place on the plane, as gl_Position has them
flat out vec2 depth;   // what is added to them over the half depth
flat out mat3 frame;   // of the normals in the picture
flat out vec3 paint;
#ifdef READ
out vec3 position;     // in the plant's frame and unit
flat out vec3 deep;    // the half depth
flat out float number;
#endif

vec4 texel(int billboard, int part) {
    int per_row = textureSize(quads, 0).x / TEXELS;
    return texelFetch(quads, ivec2(TEXELS * (billboard % per_row) + part, billboard / per_row), 0);
}

void main() {
    int billboard = gl_VertexID / 4, corner = gl_VertexID % 4;
    gl_Position = NOWHERE;
    uv = plane = depth = vec2(0.0);
    frame = mat3(1.0);
    paint = vec3(1.0);
#ifdef READ
    position = deep = vec3(0.0);
    number = float(billboard);
#endif
    vec4 normal_above = texel(billboard, 3);
    if (!let_through(billboard, int(normal_above.w), in_eye)) return;
    vec4 center = texel(billboard, 0), right = texel(billboard, 1), up = texel(billboard, 2);
    vec3 normal = normal_above.xyz;
    bool behind = dot(in_eye - center.xyz, normal) < 0.0;
    if (behind && center.w == ONE_SIDED) return;
    bool back = behind && center.w == DIFFERENT;
    vec4 rect = texel(billboard, back ? 5 : 4);

    vec2 at = vec2(corner == 1 || corner == 2 ? 1.0 : -1.0, corner >= 2 ? 1.0 : -1.0);
    vec3 local = center.xyz + at.x * right.xyz + at.y * up.xyz;
    vec3 out_of = right.w * (back ? -normal : normal);
    gl_Position = view_projection * vec4(placed(local), 1.0);
    plane = gl_Position.zw;
    depth = (view_projection * vec4(in_place.w * turned_about_y(out_of), 0.0)).zw;
    uv = (rect.xy + rect.zw * (0.5 + 0.5 * at * vec2(1.0, -1.0))) / atlas_size;
    // one picture for both sides shows normals turned to the viewer, as double-sided faces have them
    vec3 n = turned_about_y(normal), u = turned_about_y(right.xyz), v = turned_about_y(up.xyz);
    u /= max(length(u), 1e-30);
    v /= max(length(v), 1e-30);
    frame = mat3(u, v, back ? -n : n) * (behind && !back ? -1.0 : 1.0);
#ifdef PAINTED
    paint = palette[min(1 + int(up.w), PAINTED - 1)];
#endif
#ifdef READ
    position = local;
    deep = out_of;
#endif
}
