in vec3 place;
in vec3 facing;
in vec3 rest_place;
in vec3 rest_normal;
flat in int piece;
flat in int slot;

#if defined(SHADOW)
void main() {}
#elif defined(IDENTITY)
out uint number;
void main() { number = uint(slot + 1); }
#else
out vec4 colour;

void main() {
    vec3 normal = normalize(facing);
    Material material = clothes(slot, piece, rest_place, normalize(rest_normal));
    colour = displayed(hazy(lit(material.colour, material.gloss, place, normal), place));
    if (slot == picked) colour.rgb = mix(colour.rgb, vec3(1.0, 0.72, 0.1), 0.45);
}
#endif
