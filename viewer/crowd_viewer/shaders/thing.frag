in vec3 place;
in vec3 facing;
flat in vec3 own;
out vec4 colour;

void main() {
    colour = displayed(hazy(lit(pow(own, vec3(2.2)), 0.12, place, normalize(facing)), place));
}
