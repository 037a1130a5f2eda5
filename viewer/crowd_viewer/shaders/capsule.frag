in vec2 across;
in vec3 flat_place;
flat in vec4 rotation;
flat in vec2 rotation_yaw;
flat in vec4 start;
flat in vec4 end;
flat in vec3 view;
flat in vec3 side;
flat in vec2 limb;
flat in int worn;
flat in vec4 ends;
flat in int slot;

#if defined(IDENTITY)
out uint number;
#elif !defined(SHADOW)
out vec4 colour;
#endif

void main() {
    float beyond = across.y - clamp(across.y, -start.w, start.w);
    float away = across.x * across.x + beyond * beyond;
#if defined(SHADOW) || defined(IDENTITY)
    if (away > 1.0) discard;
#else
    float rim = 1.0 - sqrt(away), pixel = fwidth(rim);
    float cover = clamp(rim / max(pixel, 1e-4) + 0.5, 0.0, 1.0);
    if (cover <= SMALLEST_COVER) discard;
#endif
    float depth = sqrt(max(1.0 - away, 0.0));
    vec3 up = cross(view, side);
    vec3 normal = normalize(side * across.x + up * beyond + view * depth);
    vec3 place = flat_place + view * (end.w * depth);
#ifdef DEEP
    vec4 clip = to_clip * vec4(place, 1.0);
    gl_FragDepth = clamp(0.5 + 0.5 * clip.z / clip.w, 0.0, 1.0);
#endif
#if defined(IDENTITY)
    number = uint(slot + 1);
#elif !defined(SHADOW)
    vec3 n = vec3(rotation_yaw.y * normal.x - rotation_yaw.x * normal.z, normal.y,
                  rotation_yaw.y * normal.z + rotation_yaw.x * normal.x);
    vec3 rest_normal = turned(vec4(rotation.x, -rotation.yzw), n);
    float share = clamp(0.5 + 0.5 * across.y / max(start.w, 1e-4), 0.0, 1.0);
    vec3 rest_place = mix(start.xyz, end.xyz, share) + end.w * rest_normal;
    int piece = worn > 0 ? worn - 1 : piece_at(rest_place, limb, vec4(ends.xyz, abs(ends.w)), ends.w > 0.0);
    Material material = clothes(slot, piece, rest_place, rest_normal, vec2(0.0));
    vec3 light = lit(material.colour, material.gloss, place, normal);
    colour = displayed(hazy(light, place));
    if (slot == picked) colour.rgb = mix(colour.rgb, vec3(1.0, 0.72, 0.1), 0.45);
    colour.a = cover;
#endif
}
