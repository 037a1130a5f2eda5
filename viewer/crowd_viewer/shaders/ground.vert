in vec2 corner;
uniform vec3 middle_and_reach;
out vec3 place;

void main() {
    place = vec3(middle_and_reach.xy + corner * middle_and_reach.z, 0.0).xzy;
    gl_Position = to_clip * vec4(place, 1.0);
}
