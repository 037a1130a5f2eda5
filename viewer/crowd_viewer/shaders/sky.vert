in vec2 corner;
uniform mat4 from_clip;
out vec3 far_point;

void main() {
    vec4 point = from_clip * vec4(corner, 1.0, 1.0);
    far_point = point.xyz / point.w;
    gl_Position = vec4(corner, 1.0, 1.0);
}
