// A surface seen by a camera: positions relative to the plant's origin.
uniform mat4 view_projection;

in vec4 in_position_u;
in vec4 in_normal_v;
in vec4 in_color;
#ifdef EXPOSURE
in vec2 in_exposure;
#endif

out vec3 position;
out vec3 normal;
out vec2 uv;
out vec4 vertex_color;
out vec2 exposure;

void main() {
    position = in_position_u.xyz;
    normal = in_normal_v.xyz;
    uv = vec2(in_position_u.w, in_normal_v.w);
    vertex_color = in_color;
#ifdef EXPOSURE
    exposure = in_exposure;
#else
    exposure = vec2(1.0);
#endif
    gl_Position = view_projection * vec4(position, 1.0);
}
