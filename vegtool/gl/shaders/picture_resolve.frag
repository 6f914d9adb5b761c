// K x K samples to one texel: colour averaged in linear light over what is covered (straight
// alpha), coverage as alpha, depth averaged; normals, where there are any, averaged and made unit
// again; what is baked of light, with LIGHT, averaged.
#include "srgb.glsl"

uniform sampler2D color_samples;
uniform sampler2D depth_samples;
#ifdef NORMALS
uniform sampler2D normal_samples;
#endif
#ifdef LIGHT
uniform sampler2D light_samples;
#endif
uniform int samples;
uniform ivec2 corner;  // of the tile in the atlas

layout(location = 0) out vec4 out_color;
layout(location = 1) out float out_depth;
#ifdef NORMALS
layout(location = 2) out vec4 out_normal;
#endif
#ifdef LIGHT
layout(location = LIGHT) out vec4 out_light;
#endif

void main() {
    ivec2 first = (ivec2(gl_FragCoord.xy) - corner) * samples;
    vec3 color = vec3(0.0), normal = vec3(0.0);
    vec4 light = vec4(0.0);
    float depth = 0.0, covered = 0.0;
    for (int y = 0; y < samples; ++y) {
        for (int x = 0; x < samples; ++x) {
            ivec2 at = first + ivec2(x, y);
            vec4 sampled = texelFetch(color_samples, at, 0);
            if (sampled.a > 0.5) {
                covered += 1.0;
                color += sampled.rgb * sampled.rgb;
#ifdef NORMALS
                normal += texelFetch(normal_samples, at, 0).xyz * (1023.0 / 511.0) - 512.0 / 511.0;
#endif
#ifdef LIGHT
                light += texelFetch(light_samples, at, 0);
#endif
                depth += texelFetch(depth_samples, at, 0).x;
            }
        }
    }
    out_color = vec4(0.0);
    out_depth = 0.0;
    if (covered > 0.0) {
        out_color = vec4(srgb_from_linear(color / covered), covered / float(samples * samples));
        float signed_depth = (1.0 - 2.0 * depth / covered) / 0.999;
        out_depth = (floor(clamp(signed_depth, -1.0, 1.0) * 32767.0 + 0.5) + 32768.0) / 65535.0;
    }
#ifdef NORMALS
    out_normal = vec4(128.0, 128.0, 255.0, 255.0) / 255.0;
    if (covered > 0.0) {
        // opposite normals may leave nothing
        vec3 n = length(normal) > 1e-3 * covered ? normalize(normal) : vec3(0.0, 0.0, 1.0);
        out_normal.xyz = floor(n * 127.5 + 128.001) / 255.0;
    }
#endif
#ifdef LIGHT
    out_light = covered > 0.0 ? light / covered : vec4(0.0);
#endif
}
