// What there is to be lit, unlit: for those who do light in arrays, and to see whether both agree.
// With SUNS, the light of what is seen, in place of its albedo.
#include "material.glsl"
#include "lit.glsl"

in vec3 position;
in vec3 normal;
in vec2 uv;
in vec4 vertex_color;
in vec2 exposure;

uniform int first_face;

layout(location = 0) out vec4 out_color;     // albedo, or light; face, from 1 on, 0 where nothing is
layout(location = 1) out vec4 out_normal;    // turned to the viewer; exposure of the viewer's side
layout(location = 2) out vec4 out_side;      // normal of the face itself; exposure of the other side
layout(location = 3) out vec4 out_position;  // as uploaded; share of light passing through

void main() {
    vec3 color = surface_color(uv, vertex_color);
    vec3 n = turned(surface_normal(normal, position, uv), gl_FrontFacing);
    Surface s = surface(color, n, exposure, uv, gl_FrontFacing);
    vec3 across = cross(dFdx(position), dFdy(position));  // towards the viewer, whatever the face
#ifdef SUNS
    color = min(lit(s, position), 1.0);
#endif
    out_color = vec4(color, float(first_face + gl_PrimitiveID + 1));
    out_normal = vec4(s.normal, s.exposure.x);
    out_side = vec4(across / max(length(across), 1e-30), s.exposure.y);
    out_position = vec4(position, s.transmission);
}
