// What the sun sees. lighting/shadow.py says the same in arrays.
// Depth maps, each from another point of the sun's disc: the mean of sharp shadows is the
// soft one, with penumbrae as wide as they are far from what throws them.
// They lie side by side in one texture, SUNS_ACROSS to a row.
uniform sampler2D sun_depth;
uniform int sun_side;       // texels, of a map
uniform mat4 to_sun[SUNS];  // from positions as uploaded to a map's 0..1, depth 0 at the sun
uniform float sun_texel;    // of a map, in units of the positions
uniform vec2 sun_bias;      // texels off the surface, along its normal and towards the sun

// Share of the sun's disc that a place sees. side: unit, of the face itself, either way.
float sun_visible(vec3 position, vec3 side) {
    vec3 off = dot(side, sun_direction) < 0.0 ? -side : side;
    vec3 from = position + sun_texel * (sun_bias.x * off + sun_bias.y * sun_direction);
    float total = 0.0;
    for (int i = 0; i < SUNS; ++i) {
        vec3 at = (to_sun[i] * vec4(from, 1.0)).xyz;
        vec2 texel = at.xy * float(sun_side) - 0.5;
        ivec2 first = ivec2(floor(texel));
        vec2 share = texel - vec2(first);
        ivec2 corner = sun_side * ivec2(i % SUNS_ACROSS, i / SUNS_ACROSS);
        float from_sun = min(at.z, 1.0);  // what lies behind all that is in the map
        vec4 lit;
        for (int k = 0; k < 4; ++k) {
            ivec2 place = first + ivec2(k & 1, k >> 1);
            bool outside = any(lessThan(place, ivec2(0))) || any(greaterThanEqual(place, ivec2(sun_side)));
            float depth = outside ? 1.0 : texelFetch(sun_depth, corner + place, 0).x;
            lit[k] = from_sun <= depth ? 1.0 : 0.0;
        }
        total += mix(mix(lit.x, lit.y, share.x), mix(lit.z, lit.w, share.x), share.y);
    }
    return total / float(SUNS);
}
