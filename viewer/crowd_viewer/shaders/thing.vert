// A thing that people can grasp: a shape stretched to its size, turned and put to its place.
in vec3 point;
in vec3 normal;
in float end;                 // which end of a capsule moves with its length: -1, 0 or 1
in vec3 centre;
in vec4 turn;                 // w x y z
in vec4 size;                 // along each axis, then how far the ends are from the centre
in vec3 tint;
out vec3 place;
out vec3 facing;
flat out vec3 own;

vec3 turned(vec4 rotation, vec3 vector) {
    vec3 twice = 2.0 * cross(rotation.yzw, vector);
    return vector + rotation.x * twice + cross(rotation.yzw, twice);
}

void main() {
    place = centre + turned(turn, point * size.xyz + vec3(0.0, end * size.w, 0.0));
    facing = turned(turn, normal / size.xyz);
    own = tint;
    gl_Position = to_clip * vec4(place, 1.0);
}
