// One sample of a picture: colour with gamma 2 (10 bits are then finer than 8 bits of sRGB),
// normal; alpha marks that a surface is there. Depth is the depth buffer's.
#include "material.glsl"

in vec3 v_position;
in vec3 v_normal;
in vec2 v_uv;
in vec4 v_color;

uniform float side;

layout(location = 0) out vec4 out_color;
layout(location = 1) out vec4 out_normal;

void main() {
    vec3 color = surface_color(v_uv, v_color);
#ifdef NORMAL_MAP
    vec3 normal = mapped_normal(unit(v_normal), v_position * vec3(1.0, 1.0, side), v_uv);
#else
    vec3 normal = v_normal;
#endif
    if (!gl_FrontFacing) normal = -normal;  // glTF: a back face's normal is reversed
    // Shading normals may still point away, those of a crown do on half of its leaves. Blue is
    // below one half there: what glTF advises against, clients show, and light is wrong without.
    if (dot(normal, normal) < 1e-6) normal = vec3(0.0, 0.0, 1.0);
    normal = unit(normal);
    out_color = vec4(sqrt(color), 1.0);
    out_normal = vec4((normal * 511.0 + 512.0) / 1023.0, 1.0);
}
