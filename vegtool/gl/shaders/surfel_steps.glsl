// Which billboards and patches of triangles are drawn: those of which the step below is taken, and
// the one above is not. Holst, Schumann 2007, eq. 1, 11, 12 and 18, as products: a billboard is
// valid, or a node is applied, where its error, and what its depth moves, are at most epsilon pixels.
// A step is asked below one thing and above another, and both must hear the same: hence `precise`,
// where there is such a word.
#ifdef GL_ARB_gpu_shader5
#extension GL_ARB_gpu_shader5 : enable
#define EXACT precise
#else
#define EXACT
#endif

uniform sampler2D steps;  // two texels each: center, radius | half depth along the normal, error
uniform float pixels;     // pc / epsilon

// eye: in the frame of the steps.
bool taken(int step, vec3 eye) {
    if (step < 0) return false;
    int per_row = textureSize(steps, 0).x / 2;
    ivec2 at = ivec2(2 * (step % per_row), step / per_row);
    vec4 sphere = texelFetch(steps, at, 0);
    vec4 depth = texelFetch(steps, at + ivec2(1, 0), 0);
    EXACT vec3 to = sphere.xyz - eye;
    EXACT float away = length(to);
    EXACT float z = away - sphere.w;
    EXACT float need = depth.w * pixels;
    EXACT float moved = length(cross(depth.xyz, to)) * pixels;
    EXACT float room = z * away;
    return z > 0.0 && z >= need && moved <= room;
}

bool let_through(int below, int above, vec3 eye) {
    return taken(below, eye) && !taken(above, eye);
}
