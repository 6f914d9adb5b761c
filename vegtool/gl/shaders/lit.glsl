// A surface under the light, with what is baked of it, and the shadows that are drawn.
#include "shading.glsl"
#ifdef SUNS
#include "shadow.glsl"
#endif

uniform float transmission;
uniform vec3 transmission_tint;
#ifdef LIGHT_MAP
uniform sampler2D light_map;
#endif

// exposure: of the front's side and the back's. normal: turned to the viewer already.
Surface surface(vec3 color, vec3 normal, vec2 exposure, vec2 uv, bool front) {
    float passing = transmission;
#ifdef LIGHT_MAP
    vec4 baked = filtered(light_map, uv);
    exposure *= baked.xy;
    passing *= baked.w;
#endif
    return Surface(color, normal, front ? exposure : exposure.yx, passing, transmission_tint);
}

// Without shadows, light that passes through a leaf has to come through the crown behind it.
vec3 lit(Surface s, vec3 position) {
#ifdef SUNS
    vec3 across = cross(dFdx(position), dFdy(position));
    float seen = sun_visible(position, across / max(length(across), 1e-30));
    return shaded(s, seen, seen);
#else
    return shaded(s, 1.0, s.exposure.y);
#endif
}
