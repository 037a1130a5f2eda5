in vec3 place;
in vec3 facing;
in vec2 at;
flat in int slot;

#if defined(SHADOW)
void main() {}
#elif defined(IDENTITY)
out uint number;
void main() { number = uint(slot + 1); }
#else
uniform sampler2D image;
uniform vec3 base_colour;     // linear
uniform int picked;
out vec4 colour;

void main() {
    vec3 own = pow(texture(image, at).rgb, vec3(2.2)) * base_colour;
    colour = displayed(hazy(lit(own, 0.06, place, normalize(facing)), place));
    if (slot == picked) colour.rgb = mix(colour.rgb, vec3(1.0, 0.72, 0.1), 0.45);
}
#endif
