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

// `at` and `normal` in rest pose; `limb`: share of the arm, and of the hand.
Material clothes(int slot, vec3 at, vec3 normal, vec2 limb) {
    vec4 skin = look(slot, 0), top = look(slot, 1), bottom = look(slot, 2), hair = look(slot, 3);
    vec4 shoe = look(slot, 4), accent = look(slot, 5), cut = look(slot, 6);
    float waist = look(slot, 7).x;
    float pixel = fwidth(at.y) + 1e-5;
    bool is_arm = limb.x > 0.5;
    float side = abs(at.x);
    // Head: hair above a line that falls from the brow to the nape.
    if (at.y > CHIN && !is_arm) {
        float ahead = at.z - HEAD_MIDDLE;
        float line = HAIR_LINE + 0.62 * clamp(ahead, -0.05, 0.08) - 0.10 * step(0.02, -ahead) * skin.w;
        float long_hair = cut.w * step(ahead, 0.005) * 0.20;
        bool is_hair = at.y > line - long_hair && hair.w > 0.0 && !(side < 0.055 && ahead > 0.062 && at.y < BROW);
        if (is_hair) return Material(hair.rgb * (0.85 + 0.3 * normal.y), 0.10);
        vec3 face = skin.rgb;
        float eyes = length(vec2(side - 0.032, (at.y - EYES) * 1.6));
        if (ahead > 0.05) {
            face = mix(face, vec3(0.05, 0.04, 0.035), 1.0 - smoothstep(0.010, 0.012 + pixel, eyes));
            float brow = length(vec2((side - 0.033) * 0.45, (at.y - EYES - 0.021) * 2.4));
            face = mix(face, hair.rgb * 0.6 + 0.2 * skin.rgb, 0.8 * (1.0 - smoothstep(0.008, 0.010 + pixel, brow)));
            float mouth = length(vec2(side * 0.42, (at.y - MOUTH) * 2.2));
            face = mix(face, skin.rgb * vec3(0.74, 0.46, 0.44), 0.8 * (1.0 - smoothstep(0.008, 0.011 + pixel, mouth)));
        }
        return Material(face, 0.05);
    }
    if (is_arm) {
        if (limb.y > 0.5 || at.y < top.w) return Material(skin.rgb, 0.05);
        float cuff = smoothstep(0.028 + pixel, 0.028, at.y - top.w);
        return Material(mix(top.rgb, top.rgb * 0.72, cuff), 0.03);
    }
    if (at.y < SHOE_TOP + 0.02 * shoe.w) {
        float sole = smoothstep(0.020 + pixel, 0.020, at.y);
        return Material(mix(shoe.rgb, mix(shoe.rgb * 0.4, vec3(0.75), step(0.5, shoe.w)), sole), 0.12);
    }
    float neck = NECK_LINE + 0.28 * side - cut.y * max(at.z - HEAD_MIDDLE + 0.03, 0.0);
    if (at.y > neck) return Material(skin.rgb, 0.05);
    if (at.y > waist) {
        vec3 cloth = top.rgb;
        int pattern = int(accent.w + 0.5);
        float wave = abs(fract(at.y * cut.z) - 0.5) * 2.0;
        if (pattern == 1) cloth = mix(cloth, accent.rgb, smoothstep(0.5 - 4.0 * pixel * cut.z, 0.5 + 4.0 * pixel * cut.z, wave));
        if (pattern == 2 && at.z > 0.0) cloth = mix(cloth, accent.rgb, 1.0 - smoothstep(0.055, 0.058 + pixel, side));
        if (pattern == 3 && at.y < CHEST + 0.06 && at.y > CHEST - 0.06) cloth = accent.rgb;
        if (pattern == 4 && at.z > 0.0 && side < 0.006 + 0.5 * pixel) cloth *= 0.5;
        return Material(cloth, 0.03);
    }
    if (at.y > bottom.w) {
        float belt = cut.x * step(waist - 0.035, at.y);
        return Material(mix(bottom.rgb, vec3(0.05, 0.035, 0.025), belt), 0.03);
    }
    return Material(skin.rgb, 0.05);
}
