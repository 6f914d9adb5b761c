// A surfel: what lies on its plane within its radius, as far away as that is.
flat in vec3 center;
flat in vec3 normal;
flat in float radius;
flat in vec3 light;

uniform mat4 view_projection;
uniform mat4 unprojection;  // its inverse
uniform vec2 size;          // of the picture, pixels

out vec4 fragment;

void main() {
    vec2 at = 2.0 * gl_FragCoord.xy / size - 1.0;
    vec4 beyond = unprojection * vec4(at, 1.0, 1.0);
    vec3 ray = beyond.xyz / beyond.w;  // from the eye, which is at zero
    float across = dot(ray, normal);
    if (across > -1e-6 * length(ray)) discard;
    vec3 place = ray * (dot(center, normal) / across);
    vec3 off = place - center;
    if (dot(off, off) > radius * radius) discard;
    vec4 clip = view_projection * vec4(place, 1.0);
    gl_FragDepth = 0.5 + 0.5 * clip.z / clip.w;
#ifdef OVERDRAW
    fragment = vec4(vec3(OVERDRAW), 1.0);
#else
    fragment = vec4(light, 1.0);
#endif
}
