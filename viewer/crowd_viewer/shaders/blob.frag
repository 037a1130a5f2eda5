in vec2 at;
flat in float strength;
out vec4 colour;

void main() {
    float away = min(dot(at, at), 1.0);
    colour = vec4(0.0, 0.0, 0.0, strength * (1.0 - away) * (1.0 - away));
}
