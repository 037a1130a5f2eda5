in vec3 place;
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

// How much of the pixel is covered by joints between slabs of a size, m.
float joints(vec2 at, float size, float width) {
    vec2 pixel = fwidth(at) + 1e-5;
    vec2 away = abs(fract(at / size - 0.5) - 0.5) * size;
    vec2 cover = clamp((0.5 * width + 0.5 * pixel - away) / pixel, 0.0, 1.0) * min(vec2(1.0), width / pixel);
    return max(cover.x, cover.y);
}

void main() {
    vec2 at = place.xz;
    float pixel = max(fwidth(at.x), fwidth(at.y));
    vec2 beyond = max(ground.xy - at, at - ground.zw);
    float outside = max(beyond.x, beyond.y);
    float grain = mix(noise(at * 38.0), 0.5, smoothstep(0.008, 0.03, pixel));
    float patches = 0.6 * noise(at * 0.23) + 0.4 * noise(at * 1.1 + 7.0);
    vec3 slab = vec3(0.285, 0.268, 0.242);
    slab *= 1.0 + 0.13 * (chance(ivec2(floor(at))) - 0.5) * smoothstep(0.6, 0.15, pixel);
    slab *= 0.90 + 0.14 * patches + 0.09 * (grain - 0.5);
    slab = mix(slab, slab * 0.55, joints(at, 1.0, 0.012) * exp(-pixel * 6.0));
    slab = mix(slab, slab * 0.62, joints(at, 5.0, 0.035));
    vec3 lawn = mix(vec3(0.075, 0.115, 0.035), vec3(0.125, 0.15, 0.055), patches) * (0.86 + 0.28 * grain);
    float edge = max(pixel, 0.002);
    vec3 kerb = vec3(0.37, 0.36, 0.34) * (0.93 + 0.14 * grain);
    vec3 base = mix(slab, kerb, smoothstep(-edge, edge, outside));
    base = mix(base, lawn, smoothstep(-edge, edge, outside - 0.18));
    vec3 light = SKY_LIGHT * 0.92 + SUN_LIGHT * sun.y * sunlight(place, vec3(0.0, 1.0, 0.0));
    colour = displayed(hazy(base * light, place));
}
