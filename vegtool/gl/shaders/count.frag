// A fragment that shows nothing and is counted.
out vec4 fragment;

void main() {
    fragment = vec4(1.0);
}
