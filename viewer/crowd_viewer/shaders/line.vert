// A segment widened to a quad: core profiles may draw lines no wider than a pixel.
in vec3 start;
in vec3 end;
in vec4 tint;
uniform vec3 size_and_width;
flat out vec4 shade;

void main() {
    vec4 a = to_clip * vec4(start, 1.0), b = to_clip * vec4(end, 1.0);
    // Cut at the plane of the eye, behind which nothing can be projected.
    float nearest = 1e-3;
    if (a.w < nearest && b.w < nearest) { gl_Position = vec4(2.0, 2.0, 2.0, 1.0); return; }
    if (a.w < nearest) a = mix(b, a, (b.w - nearest) / (b.w - a.w));
    if (b.w < nearest) b = mix(a, b, (a.w - nearest) / (a.w - b.w));
    vec2 along = (b.xy / b.w - a.xy / a.w) * size_and_width.xy;
    along = dot(along, along) > 1e-8 ? normalize(along) : vec2(1.0, 0.0);
    vec4 at = (gl_VertexID >> 1) == 0 ? a : b;
    float side = (gl_VertexID & 1) == 0 ? -1.0 : 1.0;
    at.xy += side * vec2(-along.y, along.x) * size_and_width.z / size_and_width.xy * at.w;
    at.z -= 1e-4 * at.w;
    shade = tint;
    gl_Position = at;
}
