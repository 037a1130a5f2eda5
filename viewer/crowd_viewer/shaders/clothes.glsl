// What people wear, from the place on the body in rest pose and from a table with a row for each slot.
uniform sampler2D looks;
uniform int picked;

struct Material {
    vec3 colour;
    float gloss;
};

vec4 look(int slot, int column) {
    return texelFetch(looks, ivec2((slot / ROWS) * LOOK_COLUMNS + column, slot % ROWS), 0);
}

const int SKIN = 0, TOP = 1, BOTTOM = 2, HAIR = 3, SHOE = 4, EXTRA = 5;

// Capsules are small on the screen: PLAIN leaves out what is not seen there.
#ifndef PLAIN
uint mixed(uint x) {
    x ^= x >> 16; x *= 0x7feb352dU; x ^= x >> 15; x *= 0x846ca68bU; x ^= x >> 16;
    return x;
}

float lattice(ivec3 cell) {
    uint key = uint(cell.x) * 0x9e3779b9U ^ mixed(uint(cell.y) * 0x85ebca6bU ^ mixed(uint(cell.z)));
    return float(mixed(key)) / 4294967295.0;
}

float noise(vec3 at) {
    ivec3 cell = ivec3(floor(at));
    vec3 part = fract(at);
    part = part * part * (3.0 - 2.0 * part);
    vec4 near = vec4(lattice(cell), lattice(cell + ivec3(1, 0, 0)), lattice(cell + ivec3(0, 1, 0)), lattice(cell + ivec3(1, 1, 0)));
    vec4 far = vec4(lattice(cell + ivec3(0, 0, 1)), lattice(cell + ivec3(1, 0, 1)), lattice(cell + ivec3(0, 1, 1)), lattice(cell + ivec3(1, 1, 1)));
    vec4 between = mix(near, far, part.z);
    vec2 row = mix(between.xz, between.yw, part.x);
    return mix(row.x, row.y, part.y);
}

// Height of folds and strands above the smooth skin, m.
float relief(int slot, int piece, vec3 at) {
    vec3 shifted = at + float(slot % 97) * 0.37;
    if (piece == TOP) {
        // Folds run around the trunk and up to the shoulders.
        return 0.010 * noise(vec3(shifted.x * 7.0, shifted.y * 17.0 + 5.0 * abs(at.x), shifted.z * 7.0));
    }
    if (piece == BOTTOM) return 0.008 * noise(vec3(shifted.x * 9.0, shifted.y * 16.0 + 6.0 * at.z, shifted.z * 9.0));
    if (piece == HAIR) {
        float around = atan(at.x, at.z - HEAD_MIDDLE + 0.02);
        return 0.0017 * noise(vec3(around * 22.0, shifted.y * 9.0, length(at.xz) * 120.0));
    }
    return 0.0;
}

const float EYEBALL = 0.0125;  // radius, m

Material face(vec4 skin, vec3 hair, vec3 at, vec2 gaze, float pixel) {
    vec3 colour = skin.rgb;
    float side = abs(at.x), ahead = at.z - HEAD_MIDDLE;
    if (at.y > CHIN && ahead > 0.0) {
        // Beard: below a line from the ear to the upper lip, around the mouth.
        float lips = length(vec2(side * 0.40, at.y - MOUTH));
        float jaw = smoothstep(0.006, -0.006, at.y - (MOUTH + 0.012 + 0.35 * max(0.060 - ahead, 0.0)));
        colour = mix(colour, mix(colour, hair * 0.8, 0.8), skin.w * jaw * smoothstep(0.0, 0.025, ahead) * smoothstep(CHIN - 0.006, CHIN + 0.006, at.y) * smoothstep(0.0080, 0.0115, lips));
        if (ahead > 0.045) {
            float cheek = length(vec2(side - 0.040, at.y - EYES + 0.036)) / 0.030;
            colour = mix(colour, colour * vec3(1.05, 0.82, 0.78), 0.5 * exp(-cheek * cheek));
            vec2 eye = vec2(side - 0.0315, at.y - EYES - 0.0005);
            vec2 looking = vec2(at.x > 0.0 ? gaze.x : -gaze.x, gaze.y);
            // Lids go up and down with the eye, the upper one further, and meet at its corners.
            float lifted = eye.y - 0.35 * EYEBALL * looking.y * (1.0 - eye.x * eye.x / 0.00018);
            float open = length(vec2(eye.x, lifted * (lifted > 0.0 ? 2.5 / (1.0 + 1.1 * looking.y) : 2.1)));
            // What is smaller than a pixel fades instead of growing to its size.
            float clear = min(0.0035 / pixel, 1.0);
            float white = clear * (1.0 - smoothstep(0.0125, 0.0135 + pixel, open));
            colour = mix(colour, vec3(0.50, 0.47, 0.45), 0.85 * white);
            vec3 iris = mix(vec3(0.035, 0.020, 0.013), vec3(0.10, 0.13, 0.15), step(0.35, skin.r) * step(0.12, hair.r));
            // Seen from ahead, the iris of an eye that looks aside is narrow.
            vec2 away = eye - EYEBALL * looking;
            float along = dot(away, looking);
            float ring = sqrt(dot(away, away) + along * along / max(1.0 - dot(looking, looking), 0.1));
            colour = mix(colour, iris, white * (1.0 - smoothstep(0.0052, 0.0062 + pixel, ring)));
            float lid = abs(open - 0.0135) + max(-eye.y, 0.0) * 0.6;
            colour = mix(colour, vec3(0.05, 0.03, 0.025), 0.8 * clear * (1.0 - smoothstep(0.0014, 0.0032 + pixel, lid)));
            float brow = length(vec2((side - 0.034) * 0.42, (at.y - EYES - 0.0185 + 6.0 * (side - 0.03) * (side - 0.03)) * 2.2));
            colour = mix(colour, hair * 0.7 + 0.1 * skin.rgb, 0.85 * clear * (1.0 - smoothstep(0.0065, 0.009 + pixel, brow)));
            colour = mix(colour, skin.rgb * vec3(0.80, 0.52, 0.50), 0.65 * clear * (1.0 - smoothstep(0.0070, 0.0105 + pixel, lips)));
            colour *= 1.0 - 0.5 * clear * (1.0 - smoothstep(0.0008, 0.0025 + pixel, abs(at.y - MOUTH) + max(side - 0.020, 0.0)));
        }
    }
    return Material(colour, 0.06);
}

#endif

Material top_cloth(int slot, vec3 at, float pixel) {
    vec4 top = look(slot, 1), accent = look(slot, 5), cut = look(slot, 6);
    vec3 cloth = top.rgb;
    float side = abs(at.x);
    int pattern = int(accent.w + 0.5);
    float wave = abs(fract(at.y * cut.z) - 0.5) * 2.0;
    if (pattern == 1) cloth = mix(cloth, accent.rgb, smoothstep(0.5 - 4.0 * pixel * cut.z, 0.5 + 4.0 * pixel * cut.z, wave));
    if (pattern == 2) cloth = mix(cloth, accent.rgb, 1.0 - smoothstep(0.06 - 0.5 * pixel, 0.06 + 0.5 * pixel, abs(at.y - CHEST)));
#ifdef PLAIN
    if (pattern == 4 && at.z > 0.0) cloth = mix(cloth, accent.rgb, step(side, 0.03));
#else
    if (pattern == 3 && at.z > 0.0) {
        vec2 print = vec2(side / 0.075, (at.y - CHEST + 0.05) / 0.060);
        cloth = mix(cloth, accent.rgb, 0.85 * (1.0 - smoothstep(0.9, 0.95 + 8.0 * pixel, length(print))));
    }
    if (pattern == 4 && at.z > 0.0) {
        float open = 0.016 + 0.10 * clamp(at.y - CHEST + 0.35, 0.0, 0.5);
        cloth = mix(cloth, accent.rgb, 1.0 - smoothstep(open, open + 0.003 + pixel, side));
        cloth *= 1.0 - 0.5 * (1.0 - smoothstep(0.002, 0.006 + pixel, abs(side - open)));
    }
    if (pattern == 5 && at.z > 0.0 && side < 0.004 + 0.5 * pixel) cloth *= 0.5;
#endif
    return Material(cloth, 0.02);
}

// `piece`: what it belongs to; `at` and `normal` in rest pose; `gaze`: see mesh.vert.
Material clothes(int slot, int piece, vec3 at, vec3 normal, vec2 gaze) {
#ifdef PIXEL
    float pixel = PIXEL;
#else
    float pixel = fwidth(at.y) + 1e-5;
#endif
#ifdef PLAIN
    if (piece == SKIN) return Material(look(slot, 0).rgb, 0.06);
    if (piece == HAIR) return Material(look(slot, 3).rgb * (0.87 + 0.25 * normal.y), 0.10);
#else
    if (piece == SKIN) return face(look(slot, 0), look(slot, 3).rgb, at, gaze, pixel);
    if (piece == HAIR) {
        float around = atan(at.x, at.z - HEAD_MIDDLE + 0.02);
        float strands = mix(noise(vec3(around * 30.0, at.y * 11.0, 3.0)), 0.5, smoothstep(0.002, 0.008, pixel));
        return Material(look(slot, 3).rgb * (0.62 + 0.5 * strands + 0.25 * normal.y), 0.10);
    }
#endif
    if (piece == TOP) return top_cloth(slot, at, pixel);
    if (piece == BOTTOM) {
        float belt = look(slot, 6).x * step(look(slot, 7).x - 0.035, at.y);
        return Material(mix(look(slot, 2).rgb, vec3(0.05, 0.035, 0.025), belt), 0.03);
    }
    if (piece == SHOE) {
        vec4 shoe = look(slot, 4);
        float sole = smoothstep(0.020 + pixel, 0.020, at.y);
        return Material(mix(shoe.rgb, mix(shoe.rgb * 0.4, vec3(0.75), step(0.5, shoe.w)), sole), 0.12);
    }
    return Material(look(slot, 5).rgb, 0.05);
}

// The piece that a place on a capsule belongs to; `limb`: share of the arm, and of the hand; `ends` of clothes.
int piece_at(vec3 at, vec2 limb, vec4 ends, bool has_hair) {
    if (limb.x > 0.5) return limb.y > 0.5 || at.y < ends.x ? SKIN : TOP;
    if (at.y > CHIN) {
        float ahead = at.z - HEAD_MIDDLE;
        float line = HAIR_LINE + 0.62 * clamp(ahead, -0.05, 0.08) - 0.10 * step(0.02, -ahead);
        return at.y > line && has_hair ? HAIR : SKIN;
    }
    if (at.y < max(ends.w - 0.04, 0.06)) return SHOE;
    if (at.y > NECK_LINE + 0.28 * abs(at.x)) return SKIN;
    if (at.y > ends.y) return TOP;
    return at.y > ends.z ? BOTTOM : SKIN;
}
