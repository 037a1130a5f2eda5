// Tiny people: a stroke for each chain of two limbs, lit and dressed at its corners alone.
in vec2 corner;
uniform sampler2D limbs;   // as for capsules
out vec3 shade;

// The first and the last limb of each stroke: both sides of the trunk, head, legs and arms.
const ivec2 CHAINS[STROKES] = ivec2[](
    ivec2(0, 1), ivec2(2, 3), ivec2(4, 4), ivec2(5, 6), ivec2(9, 10), ivec2(7, 8), ivec2(11, 12));
// Share of the radius by which a stroke goes on beyond its ends: as much area as a round end has.
const float END = 0.785;

void main() {
    int row = first + gl_InstanceID;
    Root root = root_of(row);
    ivec2 chain = CHAINS[gl_VertexID / 4];
    bool is_last = corner.y > 0.0;
    // The ends of both limbs; what is worn goes by the one at this corner.
    vec3 ends[2];
    vec4 turn;
    vec3 rest;
    float radius = 0.0, part = 0.0;
    for (int k = 0; k < 2; k++) {
        int number = 3 * chain[k];
        vec4 a = texelFetch(limbs, ivec2(number + 3, root.build), 0);
        vec4 b = texelFetch(limbs, ivec2(number + 4, root.build), 0);
        vec4 c = texelFetch(limbs, ivec2(number + 5, root.build), 0);
        int joint = int(b.w + 0.5);
        vec4 rotation = texelFetch(palette, palette_texel(row - palette_first, 2 * joint), 0);
        vec4 moved = texelFetch(palette, palette_texel(row - palette_first, 2 * joint + 1), 0) * REACH;
        ends[k] = to_world(root, moved.xyz + moved.w * turned(rotation, k == 0 ? a.xyz : b.xyz));
        radius += 0.5 * a.w * moved.w;
        if (is_last == (k == 1)) {
            turn = rotation;
            rest = c.xyz + mix(a.xyz, b.xyz, k == 0 ? 0.25 : 0.75);
            part = c.w;
        }
    }
    vec3 along = ends[1] - ends[0], middle = 0.5 * (ends[0] + ends[1]);
    vec3 view = towards_eye(middle);
    vec3 side = cross(along, view);
    if (dot(side, side) < 1e-8) side = cross(abs(view.y) < 0.9 ? vec3(0.0, 1.0, 0.0) : vec3(1.0, 0.0, 0.0), view);
    side = normalize(side);
    vec3 up = cross(view, side);
    if (dot(up, along) < 0.0) { up = -up; side = -side; }
    vec3 place = (is_last ? ends[1] : ends[0]) + radius * (side * corner.x + END * corner.y * up);

    vec3 normal = normalize(view + 0.7 * corner.x * side + 0.35 * corner.y * up);
    vec3 n = vec3(root.cosine * normal.x - root.sine * normal.z, normal.y,
                  root.cosine * normal.z + root.sine * normal.x);
    vec3 rest_normal = turned(vec4(turn.x, -turn.yzw), n);
    vec3 rest_place = rest + radius * rest_normal;
    vec4 worn = texelFetch(limbs, ivec2(0, root.build), 0);
    vec2 limb = vec2(part == 1.0 || part == 2.0 ? 1.0 : 0.0, part == 2.0 ? 1.0 : 0.0);
    int piece = piece_at(rest_place, limb, vec4(worn.xyz, abs(worn.w)), worn.w > 0.0);
    Material material = clothes(root.slot, piece, rest_place, rest_normal, vec2(0.0));
    shade = displayed(hazy(lit(material.colour, material.gloss, place, normal), place)).rgb;
    if (root.slot == picked) shade = mix(shade, vec3(1.0, 0.72, 0.1), 0.45);
    gl_Position = to_clip * vec4(place, 1.0);
}
