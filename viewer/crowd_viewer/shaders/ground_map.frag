in vec2 share;
uniform sampler2D cells;
out vec4 colour;

void main() {
    ivec2 size = textureSize(cells, 0);
    colour = texelFetch(cells, min(ivec2(share * vec2(size)), size - 1), 0);
}
