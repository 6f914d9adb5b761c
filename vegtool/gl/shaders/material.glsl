// A surface in glTF's terms; set by PlantBuffers.use. Colours are linear: the texture is sRGB8.
uniform sampler2D color_map;
uniform vec4 base_color;
uniform float alpha_cutoff;  // 0 for opaque materials: nothing is below it

#ifdef MIPMAPPED
#include "filter.glsl"
#else
#define filtered texture
#endif

#ifdef SOFT_EDGES
#include "soft_edges.glsl"
#endif

vec3 surface_color(vec2 uv, vec4 vertex_color) {
    vec4 color = base_color * vertex_color;
#ifndef NO_COLOR_MAP
    color *= filtered(color_map, uv);
#endif
#ifdef SOFT_EDGES
    if (alpha_cutoff > 0.0) cover(color.a, alpha_cutoff);
#else
    if (color.a < alpha_cutoff) discard;
#endif
    return color.rgb;
}

// What is halfway between opposite normals has no direction, and stays 0.
vec3 unit(vec3 v) {
    return v / max(length(v), 1e-12);
}

#ifdef NORMAL_MAP
uniform sampler2D normal_map;
uniform float normal_scale;
#ifdef TANGENTS
in vec4 tangent;  // w: the bitangent's sign, glTF 2.0 section 3.7.2.1

// One tap: what is averaged of a normal is lost to shading either way.
vec3 mapped_normal(vec3 normal, vec3 position, vec2 uv) {
    vec3 along = unit(tangent.xyz - normal * dot(normal, tangent.xyz));
    vec3 texel = texture(normal_map, uv).xyz * 2.0 - 1.0;
    texel.xy *= normal_scale;
    return unit(along * texel.x + tangent.w * cross(normal, along) * texel.y + normal * texel.z);
}
#else

// The frame comes from screen derivatives (dP/du and -dP/dv, solved, so that it holds whatever way
// up the picture lies): the reader drops tangents, and models of plants rarely carry them.
vec3 mapped_normal(vec3 normal, vec3 position, vec2 uv) {
    vec3 dp1 = dFdx(position), dp2 = dFdy(position);
    vec2 duv1 = dFdx(uv), duv2 = dFdy(uv);
    float det = duv1.x * duv2.y - duv2.x * duv1.y;
    if (abs(det) < 1e-20) return normal;
    vec3 along_u = (dp1 * duv2.y - dp2 * duv1.y) * sign(det);
    vec3 along_v = (dp1 * duv2.x - dp2 * duv1.x) * sign(det);  // towards smaller v: glTF's +Y
    vec3 tangent = along_u - normal * dot(normal, along_u);
    vec3 bitangent = along_v - normal * dot(normal, along_v);
    vec3 texel = filtered(normal_map, uv).xyz * 2.0 - 1.0;
    texel.xy *= normal_scale;
    return unit(unit(tangent) * texel.x + unit(bitangent) * texel.y + normal * texel.z);
}
#endif
#endif

vec3 surface_normal(vec3 normal, vec3 position, vec2 uv) {
#ifdef NORMAL_MAP
    return mapped_normal(unit(normal), position, uv);
#else
    return unit(normal);
#endif
}
