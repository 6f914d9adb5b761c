// The ground, lit at its vertices.
#include "shading.glsl"

uniform mat4 view_projection;
uniform vec3 color;

in vec3 in_position;
in vec3 in_normal;

out vec3 light;

void main() {
    light = shaded(Surface(color, normalize(in_normal), vec2(1.0), 0.0, vec3(1.0)), 1.0, 1.0);
    gl_Position = view_projection * vec4(in_position, 1.0);
}
