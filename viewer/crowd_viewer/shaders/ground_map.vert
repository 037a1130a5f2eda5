in vec2 corner;
uniform vec4 area;            // lowest x, lowest z, width, depth
out vec2 share;

void main() {
    share = corner;
    gl_Position = to_clip * vec4(area.x + corner.x * area.z, 0.006, area.y + corner.y * area.w, 1.0);
}
