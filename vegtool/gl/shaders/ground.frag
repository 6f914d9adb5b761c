in vec3 light;

out vec4 fragment;

void main() {
    fragment = vec4(light, 1.0);
}
