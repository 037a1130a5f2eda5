in vec3 place;
in vec3 facing;
flat in float top;
uniform float wood;           // 1 for what comes or goes
out vec4 colour;

void main() {
    vec3 normal = normalize(facing);
    vec3 stone = mix(vec3(0.46, 0.43, 0.39), vec3(0.60, 0.56, 0.50), smoothstep(0.3, 2.5, top));
    float along = abs(normal.x) > abs(normal.z) ? place.z : place.x;
    float course = smoothstep(0.0, 1.5 * fwidth(place.y) + 0.004, abs(fract(place.y / 0.5) - 0.5) * 0.5 - 0.006);
    float is_wall = 1.0 - smoothstep(0.5, 0.7, abs(normal.y));
    stone *= mix(1.0, 0.90 + 0.10 * course, is_wall * step(1.2, top) * smoothstep(0.12, 0.02, fwidth(place.y)));
    float across = abs(normal.y) > 0.7 ? place.x + place.z : along;
    float board = fract(across / 0.14);
    float grain = 0.5 + 0.5 * sin(90.0 * across + 2.5 * sin(3.0 * place.y + 4.0 * floor(across / 0.14)));
    vec3 plank = vec3(0.34, 0.20, 0.10) * (0.9 + 0.12 * grain * smoothstep(0.03, 0.005, fwidth(across)));
    plank *= mix(1.0, 0.6, smoothstep(0.06, 0.0, min(board, 1.0 - board)) * smoothstep(0.08, 0.02, fwidth(across)));
    stone = mix(stone, plank, wood);
    stone *= 1.0 - 0.35 * is_wall * exp(-place.y * 6.0);
    stone *= 1.0 + 0.02 * sin(along * 1.7) * is_wall;
    colour = displayed(hazy(lit(stone, 0.03, place, normal), place));
}
