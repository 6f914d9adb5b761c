// A vertex of one of many plants, relative to the eye. An element is drawn where its rank is below
// the share that its plant keeps; the last ones grow as that does, so that none pops.
#ifdef VERTEX_LIT
#include "shading.glsl"
uniform vec4 base_color;
uniform float transmission;
uniform vec3 transmission_tint;
#endif

uniform mat4 view_projection;

in vec4 in_position_u;
in vec4 in_normal_v;
in vec4 in_color;
in vec4 in_middle_rank;  // of the element
in vec4 in_more;         // exposure of both sides; whether the element is enlarged; is without texels
#ifdef TANGENTS
in vec4 in_tangent;
#endif
in vec4 in_place;        // of the plant's foot; its scale
in vec4 in_turn;         // cosine and sine of its turn about y; share kept; length of what is enlarged
in vec3 in_shown;        // texels shown, see reveal.glsl; factor of its width; share of what has none
in vec4 in_tint;         // 0 to 255

out vec3 position;
out vec3 normal;
out vec2 uv;
#ifdef TANGENTS
out vec4 tangent;
#endif
out vec4 vertex_color;
out vec2 exposure;
flat out float shown;
#ifdef VERTEX_LIT
out vec3 front_light;
out vec3 back_light;
#endif

vec3 turned_about_y(vec3 v) {
    return vec3(in_turn.x * v.x + in_turn.y * v.z, v.y, in_turn.x * v.z - in_turn.y * v.x);
}

void main() {
    float kept = in_turn.z * mix(1.0, in_shown.z, in_more.w);
    float size = clamp((kept - in_middle_rank.w) / max(GROWING * kept, 1e-9), 0.0, 1.0);
    size *= mix(1.0, in_turn.w, in_more.z);
    vec3 local = in_middle_rank.xyz + size * (in_position_u.xyz - in_middle_rank.xyz);
    local.xz *= in_shown.y;
    position = in_place.w * turned_about_y(local) + in_place.xyz;
    normal = turned_about_y(in_normal_v.xyz);
#ifdef TANGENTS
    tangent = vec4(turned_about_y(in_tangent.xyz), in_tangent.w);
#endif
    uv = vec2(in_position_u.w, in_normal_v.w);
#ifdef PAINTED
    vertex_color = vec4(in_tint.rgb / 127.5, in_color.a);
#else
    vertex_color = vec4(in_tint.rgb / 127.5 * in_color.rgb, in_color.a);
#endif
    exposure = in_more.xy;
    shown = in_shown.x;
#ifdef VERTEX_LIT
    vec3 n = normal / max(length(normal), 1e-12);
#ifdef PAINTED
    vec3 color = vertex_color.rgb;
#else
    vec3 color = base_color.rgb * vertex_color.rgb;
#endif
#ifdef UNLIT
    front_light = back_light = color;
#else
    front_light = shaded(Surface(color, n, exposure, transmission, transmission_tint), 1.0, exposure.y);
    back_light = shaded(Surface(color, -n, exposure.yx, transmission, transmission_tint), 1.0, exposure.x);
#endif
#endif
    gl_Position = view_projection * vec4(position, 1.0);
}
