// A surfel of one of many plants: a disc, drawn as a square of pixels that holds it. Brandt et al.
// 2019, section 4.2. Light falls on it here: it has one normal.
#include "shading.glsl"

in vec3 in_position;   // in the plant's frame and unit, from its center
in vec3 in_normal;
in vec3 in_color;      // linear
in vec4 in_place;      // metres from the eye to the plant's center; metres of a unit
in vec4 in_turn_size;  // cosine and sine of its turn about y; radius of the discs, in its unit; width
in vec4 in_tint;       // 0 to 255

uniform mat4 view_projection;
uniform float focal;   // pixels of a metre at a distance of one

flat out vec3 center;
flat out vec3 normal;
flat out float radius;
flat out vec3 light;

vec3 turned_about_y(vec3 v) {
    vec2 turn = in_turn_size.xy;
    return vec3(turn.x * v.x + turn.y * v.z, v.y, turn.x * v.z - turn.y * v.x);
}

void main() {
    vec3 local = vec3(in_turn_size.w, 1.0, in_turn_size.w) * in_position;
    center = in_place.w * turned_about_y(local) + in_place.xyz;
    normal = turned_to(turned_about_y(in_normal), -center);
    radius = in_place.w * in_turn_size.z;
#ifdef PAINTED
    vec3 color = in_tint.rgb / 127.5;
#else
    vec3 color = in_tint.rgb / 127.5 * in_color;
#endif
#ifdef UNLIT
    light = color;
#else
    light = shaded(Surface(color, normal, vec2(1.0), 0.0, vec3(1.0)), 1.0, 1.0);
#endif
    gl_Position = view_projection * vec4(center, 1.0);
    // what is nearer by its radius looks larger by as much
    float away = max(gl_Position.w - radius, 1e-3 * gl_Position.w);
    gl_PointSize = 2.0 * radius * focal / away + 1.0;
}
