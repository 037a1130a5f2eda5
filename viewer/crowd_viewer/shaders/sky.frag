in vec3 far_point;
out vec4 colour;

uint mixed(uint x) {
    x ^= x >> 16; x *= 0x7feb352dU; x ^= x >> 15; x *= 0x846ca68bU; x ^= x >> 16;
    return x;
}

float chance(ivec2 cell) {
    return float(mixed(uint(cell.x) * 0x9e3779b9U ^ mixed(uint(cell.y)))) / 4294967295.0;
}

float noise(vec2 at) {
    ivec2 cell = ivec2(floor(at));
    vec2 part = fract(at);
    part = part * part * (3.0 - 2.0 * part);
    return mix(mix(chance(cell), chance(cell + ivec2(1, 0)), part.x),
               mix(chance(cell + ivec2(0, 1)), chance(cell + ivec2(1, 1)), part.x), part.y);
}

// Thin clouds in a layer overhead, lost in the haze towards the horizon.
float clouds(vec3 direction) {
    if (direction.y <= 0.02 || care.x < 8.0) return 0.0;
    vec2 at = direction.xz / (direction.y + 0.12) * vec2(1.1, 1.7) + 3.0;
    float dense = 0.0, share = 0.5;
    for (int k = 0; k < 4; k++) {
        dense += share * noise(at);
        at = 2.1 * at + 11.0;
        share *= 0.5;
    }
    return smoothstep(0.46, 0.80, dense) * smoothstep(0.02, 0.16, direction.y);
}

void main() {
    vec3 direction = eye.w > 0.5 ? normalize(far_point - eye.xyz) : vec3(0.0, 0.02, 0.0);
    colour = displayed(mix(sky(direction), vec3(1.12, 1.10, 1.08), 0.75 * clouds(direction)));
}
