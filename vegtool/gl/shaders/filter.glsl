// Mip-mapped textures with ANISOTROPY taps at most, as GPUs filter them:
// EXT_texture_filter_anisotropic, with the smaller axis of the pixel's footprint from its area, so
// that shear counts; with one tap, plain trilinear filtering by the longer axis. Written out,
// because drivers may do something else: Mesa's software rasteriser weighs a whole ellipse, which
// takes three times as long and leaves a fifth less of a tree 100 pixels high.
const float STILL = 1e-4;  // texels, squared: a face that shows one place of the texture all over

uniform float footprint;   // of a sample, along each axis: as of a pixel, however many it has

vec4 filtered(sampler2D map, vec2 uv) {
    vec2 size = vec2(textureSize(map, 0));
    vec2 dx = footprint * dFdx(uv), dy = footprint * dFdy(uv);
    vec2 x = dx * size, y = dy * size;
    bool along_x = dot(x, x) >= dot(y, y);
    float longest = along_x ? dot(x, x) : dot(y, y);  // texels, squared
    if (longest < STILL) return textureLod(map, uv, 0.0);  // the logarithm of 0 is undefined
    float area = abs(x.x * y.y - x.y * y.x);
    float ratio = longest < ANISOTROPY * area ? max(longest / area, 1.0) : ANISOTROPY;
    float level = 0.5 * log2(longest / (ratio * ratio));
    int taps = int(ratio + 0.5);
    vec2 along = (along_x ? dx : dy) / float(taps);
    vec2 first = uv - 0.5 * float(taps - 1) * along;
    vec4 total = vec4(0.0);
    for (int i = 0; i < taps; ++i) total += textureLod(map, first + float(i) * along, level);
    return total / float(taps);
}
