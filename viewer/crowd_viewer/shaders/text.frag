in vec2 texel;
flat in float brightness;
uniform sampler2D atlas;
out vec4 colour;

void main() {
    colour = vec4(vec3(brightness), texelFetch(atlas, ivec2(texel), 0).r * mix(0.6, 1.0, brightness));
}
