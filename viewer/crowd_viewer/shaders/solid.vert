in vec3 position;
in vec3 normal;
in float height;
out vec3 place;
out vec3 facing;
flat out float top;

void main() {
    place = position;
    facing = normal;
    top = height;
    gl_Position = to_clip * vec4(position, 1.0);
}
