in vec3 position;
in vec3 normal;
in uvec4 joint;
in vec4 weight;
in float material;
in float open_sky;         // share of the light from around that the body does not keep away
uniform vec3 rest[MOST_JOINTS];
out vec3 place;
out vec3 facing;
out vec3 rest_place;
out vec3 rest_normal;
out float sky_share;
flat out int piece;
flat out int slot;
#if !defined(SHADOW) && !defined(IDENTITY)
flat out vec2 gaze;        // left and up in the direction in which the eye on this side looks, in the head's frame
#endif

void main() {
    int row = first + gl_InstanceID;
    Root root = root_of(row);
    vec3 point = vec3(0.0), direction = vec3(0.0);
    for (int k = 0; k < 4; k++) {
        int number = int(joint[k]);
        vec4 rotation = texelFetch(palette, palette_texel(row - palette_first, 2 * number), 0);
        vec4 moved = texelFetch(palette, palette_texel(row - palette_first, 2 * number + 1), 0) * REACH;
        point += weight[k] * (moved.xyz + moved.w * turned(rotation, position - rest[number]));
        direction += weight[k] * turned(rotation, normal);
    }
    place = to_world(root, point);
    facing = to_world_direction(root, direction);
    rest_place = position;
    rest_normal = normal;
    sky_share = open_sky;
    piece = int(material + 0.5);
    slot = root.slot;
#if !defined(SHADOW) && !defined(IDENTITY)
    int eye_joint = position.x > 0.0 ? LEFT_EYE_JOINT : RIGHT_EYE_JOINT;
    vec4 head_turn = texelFetch(palette, palette_texel(row - palette_first, 2 * HEAD_JOINT), 0);
    vec4 eye_turn = texelFetch(palette, palette_texel(row - palette_first, 2 * eye_joint), 0);
    gaze = turned(vec4(head_turn.x, -head_turn.yzw), turned(eye_turn, vec3(0.0, 0.0, 1.0))).xy;
#endif
    gl_Position = to_clip * vec4(place, 1.0);
}
