in vec2 place;
in float glyph;
in float shade;
uniform vec2 size;
uniform vec2 cell;
out vec2 texel;
flat out float brightness;

void main() {
    vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);
    texel = (vec2(glyph, 0.0) + corner) * cell;
    brightness = shade;
    vec2 pixel = place + corner * cell;
    gl_Position = vec4(2.0 * pixel.x / size.x - 1.0, 1.0 - 2.0 * pixel.y / size.y, 0.0, 1.0);
}
