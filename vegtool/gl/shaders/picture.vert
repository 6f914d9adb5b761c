// A vertex of the plant as one billboard's picture shows it: orthographic, seen along the plane's
// normal, moved to the picture's place in the atlas. What a picture is lies in `pictures`, four
// texels each: u, half width | v, half height | centre, half depth | x0, y0, width, height.
#ifdef EXPOSURE
const int TEXELS = 4;  // per vertex
#else
const int TEXELS = 3;
#endif

uniform sampler2D vertices;
uniform sampler2D pictures;
uniform float side;  // 1: seen from the front (u x v), -1: from the back
uniform vec4 tile;  // texels x0, y0, width, height: the part of the atlas that is drawn

in uvec2 in_vertex_picture;

out vec3 v_position;  // metres along u, v and the front normal, from the plane's centre
out vec3 v_normal;    // in the same frame, z towards the viewer
out vec2 v_uv;
out vec4 v_color;
out vec3 v_place;     // as uploaded
out vec2 v_exposure;  // of the front and the back of the face
flat out mat3 v_frame;  // from u, v and the front normal
out float v_depth;    // -1 to 1 over the half depth, towards the front
out float gl_ClipDistance[4];

vec4 item(sampler2D data, uint index, int part, int texels) {
    int per_row = textureSize(data, 0).x / texels;
    int i = int(index);
    return texelFetch(data, ivec2(texels * (i % per_row) + part, i / per_row), 0);
}

void main() {
    uint vertex = in_vertex_picture.x, picture = in_vertex_picture.y;
    vec4 position_u = item(vertices, vertex, 0, TEXELS);
    vec4 normal_v = item(vertices, vertex, 1, TEXELS);
#ifdef VERTEX_COLORS
    v_color = item(vertices, vertex, 2, TEXELS);
#else
    v_color = vec4(1.0);
#endif
#ifdef EXPOSURE
    v_exposure = item(vertices, vertex, 3, TEXELS).xy;
#else
    v_exposure = vec2(1.0);
#endif
    vec4 u = item(pictures, picture, 0, 4);
    vec4 v = item(pictures, picture, 1, 4);
    vec4 center = item(pictures, picture, 2, 4);
    vec4 rect = item(pictures, picture, 3, 4);
    mat3 frame = mat3(u.xyz, v.xyz, cross(u.xyz, v.xyz));

    v_frame = frame;
    v_place = position_u.xyz;
    v_position = (position_u.xyz - center.xyz) * frame;
    v_normal = normal_v.xyz * frame * vec3(1.0, 1.0, side);
    v_uv = vec2(position_u.w, normal_v.w);
    vec2 local = v_position.xy / vec2(u.w, v.w);
    v_depth = center.w > 0.0 ? clamp(v_position.z / center.w, -1.0, 1.0) : 0.0;

    // Row 0 of the target is the top row of the atlas, so v runs down.
    vec2 texel = rect.xy + rect.zw * (0.5 + 0.5 * local * vec2(1.0, -1.0));
    vec2 clip = 2.0 * (texel - tile.xy) / tile.zw - 1.0;
    // Nearest to the viewer wins; a margin keeps the nearest and farthest from being clipped.
    gl_Position = vec4(clip, -0.999 * side * v_depth, 1.0);
    // Nothing may reach the neighbours, whatever the caller's rectangles leave outside.
    gl_ClipDistance[0] = 1.00001 + local.x;
    gl_ClipDistance[1] = 1.00001 - local.x;
    gl_ClipDistance[2] = 1.00001 + local.y;
    gl_ClipDistance[3] = 1.00001 - local.y;
}
