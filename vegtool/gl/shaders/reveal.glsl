// Which texels of a plant that fades are shown. Colditz et al. 2005, section 4: what an alpha test
// reveals as its threshold falls; here the threshold is on a noise of its own, so that coverage and
// its mips stay what they are, and each step reveals an even share.
uniform sampler2D noise;

flat in float shown;  // what is below it is shown; negative: what is not below its opposite

#ifdef DITHERED
float noise_here() {
    return texelFetch(noise, ivec2(gl_FragCoord.xy) % textureSize(noise, 0), 0).r;
}
#else
float noise_at(vec2 uv, sampler2D map) {
    return texture(noise, uv * vec2(textureSize(map, 0)) / vec2(textureSize(noise, 0))).r;
}
#endif

void reveal(float here) {
#if defined(SOFT_EDGES) && !defined(DITHERED)
    if (shown == 0.0) samples_shown = 0;
    else if (shown < 0.0) cover(here, -shown);
    else cover(-here, -shown);
#else
    if (shown < 0.0 ? here < -shown : here >= shown) discard;
#endif
}
