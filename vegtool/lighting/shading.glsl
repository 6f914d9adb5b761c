// Light that a surface sends to the viewer, linear. lighting/shading.py says the same in arrays.
uniform vec3 sun_direction;  // unit, towards the sun
uniform float sun;
uniform vec2 sky;  // from above, from below

// What light falls on. normal: unit, or 0 where there is none. exposure: how much of the sky's
// light reaches the viewer's side and the other. transmission: share of light that passes through,
// times tint.
struct Surface {
    vec3 color;
    vec3 normal;
    vec2 exposure;
    float transmission;
    vec3 tint;
};

// Dynamic flipping (Colditz et al. 2005, section 3): what is seen from behind turns round. By the
// side of the face, as glTF says, and not by the normal itself: those of a crown's leaves lean
// over their edges, and are to stay so.
vec3 turned(vec3 normal, bool front) {
    return front ? normal : -normal;
}

// The same where there are no faces, as of surfels. to_viewer: any length.
vec3 turned_to(vec3 normal, vec3 to_viewer) {
    return turned(normal, dot(normal, to_viewer) >= 0.0);
}

float sky_light(vec3 normal) {
    return mix(sky.y, sky.x, 0.5 + 0.5 * normal.y);
}

// visible: share of the sun's disc that nothing hides, of the side that it lights. through: the
// same for light that falls on the other side.
vec3 shaded(Surface s, float visible, float through) {
    float toward = dot(s.normal, sun_direction);
    float here = sun * visible * max(toward, 0.0) + sky_light(s.normal) * s.exposure.x;
    float behind = sun * through * max(-toward, 0.0) + sky_light(-s.normal) * s.exposure.y;
    return s.color * ((1.0 - s.transmission) * here + s.transmission * behind * s.tint);
}
