// A surfel of one of many plants: a disc, drawn as a square of pixels that holds it. Brandt et al.
// 2019, section 4.2. Light falls on it here: it has one normal.
#include "shading.glsl"

in vec3 in_position;   // in the plant's frame and unit, from its center
in vec3 in_normal;
in vec3 in_color;      // linear
in float in_size;      // of the radius of the discs
#ifdef LIGHT
in vec4 in_light;      // exposure of the normal's side and the other, share that passes through
uniform vec3 transmission_tint;
#endif
in vec4 in_place;      // metres from the eye to the plant's center; metres of a unit
in vec4 in_turn_size;  // cosine and sine of its turn about y; radius of the discs, in its unit; width
in vec4 in_tint;       // 0 to 255

uniform mat4 view_projection;
uniform vec3 right;    // of a pixel at a distance of one, metres
uniform vec3 up;
uniform vec2 size;     // of the picture, pixels

flat out vec2 middle;   // pixels
flat out vec2 nearing;  // of one over the distance on the disc's plane: its part, per pixel
flat out vec3 ellipse;  // of the disc: its quadratic form, times that squared
flat out vec3 depth;    // at the middle; of that part; most to either side
flat out vec3 light;

vec3 turned_about_y(vec3 v) {
    vec2 turn = in_turn_size.xy;
    return vec3(turn.x * v.x + turn.y * v.z, v.y, turn.x * v.z - turn.y * v.x);
}

// Of something solid. A surfel seen from behind stands for what is before it, at whose edges normals
// go on. to_eye: unit.
vec3 mirrored_to(vec3 normal, vec3 to_eye) {
    return normal - 2.0 * min(dot(normal, to_eye), 0.0) * to_eye;
}

void main() {
    vec3 local = vec3(in_turn_size.w, 1.0, in_turn_size.w) * in_position;
    vec3 center = in_place.w * turned_about_y(local) + in_place.xyz;
    vec3 own = turned_about_y(in_normal), to_eye = normalize(-center);
    vec3 normal = turned_to(own, to_eye);
    float radius = in_place.w * in_turn_size.z * in_size;
#ifdef PAINTED
    vec3 color = in_tint.rgb / 127.5;
#else
    vec3 color = in_tint.rgb / 127.5 * in_color;
#endif
#ifdef UNLIT
    light = color;
#else
#ifdef LIGHT
    Surface s = Surface(color, own, in_light.xy, in_light.z, transmission_tint);
#else
    Surface s = Surface(color, own, vec2(1.0), 0.0, vec3(1.0));
#endif
#ifdef DOUBLE_SIDED
    if (dot(own, to_eye) < 0.0) s.exposure = s.exposure.yx;
    s.normal = normal;
#else
    s.normal = mirrored_to(own, to_eye);
#endif
    light = shaded(s, 1.0, s.exposure.y);  // as in lit.glsl, without shadows
#endif
    gl_Position = view_projection * vec4(center, 1.0);
    float away = gl_Position.w;
    middle = (0.5 + 0.5 * gl_Position.xy / away) * size;

    // A ray through a pixel, c + x X + y Y where it is as far away as the center c, meets the plane
    // at q times c.n / (q.n); that is off the center by (x E + y F) / (1 + nearing.(x, y)).
    vec3 x = away * right, y = away * up;
    float facing = min(dot(center, normal), -1e-4 * length(center));
    nearing = vec2(dot(x, normal), dot(y, normal)) / facing;
    vec3 e = (x - center * nearing.x) / radius, f = (y - center * nearing.y) / radius;
    ellipse = vec3(dot(e, e), 2.0 * dot(e, f), dot(f, f));
    float far = view_projection[3][2];  // of depth, what goes with one over the distance
    depth = vec3(0.5 + 0.5 * gl_Position.z / away, 0.5 * far / away, radius / away);

    // what is nearer by its radius looks larger by as much
    gl_PointSize = 2.0 * radius / (length(right) * max(away - radius, 1e-3 * away)) + 1.0;
}
