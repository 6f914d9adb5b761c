// An alpha test of each sample of a multisampled pixel, its alpha carried on straight from the middle
// of the pixel: edges of leaves are as smooth as those of triangles, and no blending and no order of
// drawing is needed. Four samples where D3D and most drivers have them; others are near enough.
const vec2 SAMPLES[4] = vec2[](
    vec2(-0.125, -0.375), vec2(0.375, -0.125), vec2(-0.375, 0.125), vec2(0.125, 0.375));
int samples_shown = 15;

void cover(float value, float threshold) {
    vec2 slope = vec2(dFdx(value), dFdy(value));
    for (int i = 0; i < 4; ++i) {
        if (value + dot(slope, SAMPLES[i]) < threshold) samples_shown &= ~(1 << i);
    }
}

void show_samples() {
    if (samples_shown == 0) discard;
    gl_SampleMask[0] = samples_shown;
}
