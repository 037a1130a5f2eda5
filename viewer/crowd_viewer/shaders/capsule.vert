// One quad for each limb that faces the eye; the fragment shader rounds it.
in vec2 corner;
uniform sampler2D limbs;   // a row a build: three texels, the first of where clothes end, then three a limb:
                           // start and radius, end and joint, rest and part
out vec2 across;
out vec3 flat_place;
flat out vec4 rotation;
flat out vec2 rotation_yaw;
flat out vec4 start;       // w: half length along the quad in radii
flat out vec4 end;         // w: radius, m
flat out vec3 view;
flat out vec3 side;
flat out vec2 limb;
flat out int worn;         // material + 1, 0 where it follows from the place
flat out vec4 ends;
flat out int slot;

void main() {
    int row = first + gl_InstanceID;
    int number = gl_VertexID / 4;
    Root root = root_of(row);
    vec4 a = texelFetch(limbs, ivec2(3 * number + 3, root.build), 0);
    vec4 b = texelFetch(limbs, ivec2(3 * number + 4, root.build), 0);
    vec4 c = texelFetch(limbs, ivec2(3 * number + 5, root.build), 0);
    int joint = int(b.w + 0.5);
    vec4 turn = texelFetch(palette, palette_texel(row - palette_first, 2 * joint), 0);
    vec4 moved = texelFetch(palette, palette_texel(row - palette_first, 2 * joint + 1), 0) * REACH;
    vec3 from = to_world(root, moved.xyz + moved.w * turned(turn, a.xyz));
    vec3 to = to_world(root, moved.xyz + moved.w * turned(turn, b.xyz));
    float radius = a.w * moved.w;
    vec3 middle = 0.5 * (from + to), along = to - from;
    view = TOWARDS;
    side = cross(along, view);
    // A limb that points at the eye, or has no length, is a disc: any direction across will do.
    if (dot(side, side) < 1e-8) side = cross(abs(view.y) < 0.9 ? vec3(0.0, 1.0, 0.0) : vec3(1.0, 0.0, 0.0), view);
    side = normalize(side);
    vec3 up = cross(view, side);
    float half_length = 0.5 * abs(dot(along, up));
    across = vec2(corner.x, corner.y * (half_length / radius + 1.0));
    flat_place = middle + side * corner.x * radius + up * corner.y * (half_length + radius);
    bool is_up = dot(along, up) >= 0.0;
    // The quad leans with the limb; one that points at the eye is drawn where its near end is.
    float lean = 0.5 * dot(along, view), length_share = half_length / (half_length + radius);
    flat_place += view * ((is_up ? lean : -lean) * corner.y * length_share + abs(lean) * (1.0 - length_share));
    start = vec4((is_up ? a.xyz : b.xyz) + c.xyz, half_length / radius);
    end = vec4((is_up ? b.xyz : a.xyz) + c.xyz, radius);
    limb = vec2(c.w == 1.0 || c.w == 2.0 ? 1.0 : 0.0, c.w == 2.0 ? 1.0 : 0.0);
    worn = c.w > 7.5 ? int(c.w - 6.5) : 0;
    ends = texelFetch(limbs, ivec2(0, root.build), 0);
    rotation = turn;
    rotation_yaw = vec2(root.sine, root.cosine);
    slot = root.slot;
    gl_Position = to_clip * vec4(flat_place, 1.0);
}
