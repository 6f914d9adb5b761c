// Samples to pixels: their plain mean in linear light, premultiplied by coverage; top row first.
#ifdef MULTISAMPLED
uniform sampler2DMS drawn;
#else
uniform sampler2D drawn;
#endif
uniform int samples;  // per pixel of a multisampled target, per axis and pixel of another
uniform int height;   // pixels

out vec4 pixel;

void main() {
    ivec2 at = ivec2(gl_FragCoord.x, height - 1 - int(gl_FragCoord.y));
    vec4 total = vec4(0.0);
#ifdef MULTISAMPLED
    for (int i = 0; i < samples; ++i) total += texelFetch(drawn, at, i);
    pixel = total / float(samples);
#else
    for (int y = 0; y < samples; ++y) {
        for (int x = 0; x < samples; ++x) total += texelFetch(drawn, at * samples + ivec2(x, y), 0);
    }
    pixel = total / float(samples * samples);
#endif
}
