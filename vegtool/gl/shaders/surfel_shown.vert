// Whether an item is drawn for an eye: 1 or 0.
#include "surfel_steps.glsl"

in ivec2 in_item;  // the steps below and above
in vec3 in_eye;

out float shown;

void main() {
    shown = let_through(in_item.x, in_item.y, in_eye) ? 1.0 : 0.0;
}
