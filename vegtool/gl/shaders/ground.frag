in vec3 light;

out vec4 fragment;

void main() {
#ifdef OVERDRAW
    fragment = vec4(vec3(OVERDRAW), 1.0);
#else
    fragment = vec4(light, 1.0);
#endif
}
