// Poses of the drawn people, as `crowd_kernels.view.pack_crowd` writes them.
uniform sampler2D palette;
uniform sampler2D roots;
uniform int first;            // row of the first person of this draw
uniform int palette_first;    // row whose pose is the first in the palette
uniform int palette_width;    // texels of one person
uniform int feet[2];          // places of the ankles in the palette

const float REACH = 4.0;

struct Root {
    vec3 position;
    int slot;
    float sine;
    float cosine;
    int build;
};

Root root_of(int row) {
    ivec2 at = ivec2((row / ROWS) * 2, row % ROWS);
    vec4 a = texelFetch(roots, at, 0), b = texelFetch(roots, at + ivec2(1, 0), 0);
    return Root(a.xyz, int(a.w + 0.5), b.x, b.y, int(b.z + 0.5));
}

ivec2 palette_texel(int row, int place) {
    return ivec2((row / ROWS) * palette_width + place, row % ROWS);
}

vec3 turned(vec4 rotation, vec3 vector) {
    vec3 twice = 2.0 * cross(rotation.yzw, vector);
    return vector + rotation.x * twice + cross(rotation.yzw, twice);
}

vec3 to_world_direction(Root root, vec3 v) {
    return vec3(root.cosine * v.x + root.sine * v.z, v.y, root.cosine * v.z - root.sine * v.x);
}

vec3 to_world(Root root, vec3 point) {
    return root.position + to_world_direction(root, point);
}
