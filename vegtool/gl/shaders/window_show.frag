// A picture, pixel by pixel, as it is; the mean of its samples where there are several.
#ifdef MULTISAMPLED
uniform sampler2DMS picture;
#else
uniform sampler2D picture;
#endif
uniform int samples;

out vec4 pixel;

void main() {
    vec4 total = vec4(0.0);
    for (int i = 0; i < samples; ++i) total += texelFetch(picture, ivec2(gl_FragCoord.xy), i);
    pixel = vec4(total.rgb / float(samples), 1.0);
}
