// A place of a plant: from its own frame and unit to metres from the eye.
in vec4 in_place;  // of the plant's center; metres of a unit
in vec3 in_eye;    // in the plant's frame and unit
in vec2 in_turn;   // cosine and sine of its turn about y

uniform mat4 view_projection;

const vec4 NOWHERE = vec4(2.0, 2.0, 2.0, 1.0);  // outside of what is seen

vec3 turned_about_y(vec3 v) {
    return vec3(in_turn.x * v.x + in_turn.y * v.z, v.y, in_turn.x * v.z - in_turn.y * v.x);
}

vec3 placed(vec3 v) {
    return in_place.w * turned_about_y(v) + in_place.xyz;
}
