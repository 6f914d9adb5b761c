// White letters on a panel that dims what lies below it.
uniform sampler2D letters;  // bottom row first
uniform ivec2 corner;       // the panel's lower left one, pixels
uniform int scale;          // pixels per texel

out vec4 pixel;

void main() {
    float letter = texelFetch(letters, (ivec2(gl_FragCoord.xy) - corner) / scale, 0).r;
    pixel = vec4(vec3(letter), mix(0.6, 1.0, letter));
}
