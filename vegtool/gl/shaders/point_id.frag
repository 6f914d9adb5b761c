// Which disc is seen. A disc is hidden where another is nearer by more than that one's radius: on
// what is convex, the planes of neighbours lie in front of a disc's middle.
flat in vec3 center;
flat in vec3 normal;
flat in float radius;
flat in float number;

uniform float pixels;

out float seen;

void main() {
    vec2 off = 2.0 * gl_FragCoord.xy / pixels - 1.0 - center.xy;
    float rise = 0.0;  // of the pixel of its middle, which all discs have, and be they a point
    if (max(abs(off.x), abs(off.y)) > 1.0 / pixels) {
        rise = -dot(off, normal.xy) / max(normal.z, 1e-3);
        if (dot(off, off) + rise * rise > radius * radius) discard;
        rise -= radius;
    }
    gl_FragDepth = 0.5 - 0.125 * (center.z + rise);
    seen = number;
}
