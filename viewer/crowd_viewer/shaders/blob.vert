// A soft dark patch below each foot: the light of the sky that the foot keeps away.
in vec2 corner;
out vec2 at;
flat out float strength;

void main() {
    int row = first + gl_InstanceID / 2;
    Root root = root_of(row);
    int joint = feet[gl_InstanceID % 2];
    vec4 moved = texelFetch(palette, palette_texel(row - palette_first, 2 * joint + 1), 0) * REACH;
    vec4 turn = texelFetch(palette, palette_texel(row - palette_first, 2 * joint), 0);
    vec3 toes = turned(turn, vec3(0.0, -0.5, 1.0) * 0.09 * moved.w);
    vec3 foot = to_world(root, moved.xyz + toes);
    vec2 along = normalize(to_world_direction(root, turned(turn, vec3(0.0, 0.0, 1.0))).xz + 1e-4);
    float height = max(foot.y - 0.03, 0.0);
    strength = 0.62 * exp(-height * 9.0);
    vec2 size = vec2(0.115, 0.19) + 0.4 * height;
    vec2 flat_place = foot.xz + corner.y * along * size.y + corner.x * vec2(along.y, -along.x) * size.x;
    at = corner;
    gl_Position = to_clip * vec4(flat_place.x, root.position.y + 0.004, flat_place.y, 1.0);
}
