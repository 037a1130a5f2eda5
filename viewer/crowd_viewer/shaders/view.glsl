// What all passes know of the camera and the light. Places count from the scene's origin, m.
layout(std140) uniform View {
    mat4 to_clip;        // of the camera, or of the light in the shadow pass
    mat4 to_light;
    vec4 eye;            // w: 1 with perspective
    vec4 ahead;          // w: softness of shadows in texels
    vec4 sun;            // direction towards it; w: depth by which shadows stand off, 0 without any
    vec4 ground;         // lowest x, lowest z, highest x, highest z
    vec4 care;           // x: places at which the rim of a shadow is looked up; no clouds below 8
};

vec3 towards_eye(vec3 place) {
    return eye.w > 0.5 ? normalize(eye.xyz - place) : -ahead.xyz;
}
