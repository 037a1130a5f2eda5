in vec3 far_point;
out vec4 colour;

void main() {
    colour = displayed(sky(eye.w > 0.5 ? normalize(far_point - eye.xyz) : vec3(0.0, 0.02, 0.0)));
}
