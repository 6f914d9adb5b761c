// Diffuse light from a sun and a sky, linear and premultiplied by coverage.
#include "material.glsl"

uniform vec3 sun_direction;  // unit, towards the sun
uniform float sun;
uniform vec2 sky;  // from above, from below

in vec3 position;
in vec3 normal;
in vec2 uv;
in vec4 vertex_color;

out vec4 fragment;

void main() {
    vec3 color = surface_color(uv, vertex_color);
    vec3 n = unit(normal);
#ifdef NORMAL_MAP
    n = mapped_normal(n, position, uv);
#endif
    if (!gl_FrontFacing) n = -n;
    float ambient = mix(sky.y, sky.x, 0.5 + 0.5 * n.y);
    fragment = vec4(color * (sun * max(dot(n, sun_direction), 0.0) + ambient), 1.0);
}
