// A disc seen from afar along parallel rays, and which it is: a square of pixels that holds it.
in vec3 in_position;  // of all within 1 about zero
in vec3 in_normal;
in float in_radius;

uniform mat3 axes;     // rows: right, up and towards the eye
uniform float pixels;  // along a side of the picture, which is 2 wide

flat out vec3 center;  // in these axes
flat out vec3 normal;  // the side that is seen
flat out float radius;
flat out float number;

void main() {
    center = axes * in_position;
    normal = axes * in_normal;
    if (normal.z < 0.0) normal = -normal;
    radius = in_radius;
    number = float(gl_VertexID + 1);
    gl_Position = vec4(center.xy, 0.0, 1.0);
    gl_PointSize = radius * pixels + 2.0;
}
