in vec3 place;
in vec3 facing;
in vec3 rest_place;
in vec3 rest_normal;
in float sky_share;
flat in int piece;
flat in int slot;

#if defined(SHADOW)
void main() {}
#elif defined(IDENTITY)
out uint number;
void main() { number = uint(slot + 1); }
#else
flat in vec2 gaze;
out vec4 colour;

// Tilt a normal as a relief of given height, m, does. Mikkelsen, "Bump mapping unparametrized surfaces on the GPU", 2010.
vec3 tilted(vec3 normal, float height) {
    vec3 right = dFdx(place), up = dFdy(place);
    vec3 first = cross(up, normal), second = cross(normal, right);
    float size = dot(right, first);
    vec3 slope = sign(size) * (dFdx(height) * first + dFdy(height) * second);
    return normalize(abs(size) * normal - slope);
}

void main() {
    vec3 normal = normalize(facing);
    float pixel = length(fwidth(rest_place));
    float detail = smoothstep(0.014, 0.004, pixel);
    if (detail > 0.0) normal = tilted(normal, detail * relief(slot, piece, rest_place));
    Material material = clothes(slot, piece, rest_place, normalize(rest_normal), gaze);
    colour = displayed(hazy(lit(material.colour, material.gloss, place, normal, sky_share), place));
    if (slot == picked) colour.rgb = mix(colour.rgb, vec3(1.0, 0.72, 0.1), 0.45);
}
#endif
