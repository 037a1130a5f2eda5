in vec3 position;
in vec3 normal;
in vec2 texture_coordinate;
in uvec4 joint;
in vec4 weight;
uniform sampler2D palette;    // for each person its slot, then three rows of a matrix for each joint
uniform int palette_width;    // texels of one person
out vec3 place;
out vec3 facing;
out vec2 at;
flat out int slot;

vec4 entry(int number) {
    int row = gl_InstanceID;
    return texelFetch(palette, ivec2((row / ROWS) * palette_width + number, row % ROWS), 0);
}

void main() {
    vec4 rows[3] = vec4[](vec4(0.0), vec4(0.0), vec4(0.0));
    for (int k = 0; k < 4; k++)
        for (int r = 0; r < 3; r++)
            rows[r] += weight[k] * entry(1 + 3 * int(joint[k]) + r);
    vec4 point = vec4(position, 1.0);
    place = vec3(dot(rows[0], point), dot(rows[1], point), dot(rows[2], point));
    facing = vec3(dot(rows[0].xyz, normal), dot(rows[1].xyz, normal), dot(rows[2].xyz, normal));
    at = texture_coordinate;
    slot = int(entry(0).x + 0.5);
    gl_Position = to_clip * vec4(place, 1.0);
}
