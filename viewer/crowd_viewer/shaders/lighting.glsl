// Sun, sky and haze; tone mapping.
uniform sampler2DShadow shadow_map;

const vec3 SUN_LIGHT = vec3(3.2, 2.85, 2.35);
const vec3 SKY_LIGHT = vec3(0.62, 0.72, 0.88);
const vec3 GROUND_LIGHT = vec3(0.42, 0.38, 0.32);
const vec3 HORIZON = vec3(0.74, 0.86, 1.02);
const float HAZE = 0.0016;
const float EXPOSURE = 0.60;

// The first four are around the middle by themselves.
const vec2 TAPS[12] = vec2[](
    vec2(-0.696, 0.457), vec2(0.519, 0.767), vec2(0.473, -0.480), vec2(-0.326, -0.406),
    vec2(0.962, -0.195), vec2(-0.840, -0.074), vec2(-0.203, 0.621), vec2(0.185, -0.893),
    vec2(0.507, 0.064), vec2(0.896, 0.412), vec2(-0.322, -0.933), vec2(-0.792, -0.598));

float sunlight(vec3 place, vec3 normal) {
    if (sun.w <= 0.0) return 1.0;
    vec3 at = (to_light * vec4(place + 0.025 * normal, 1.0)).xyz * 0.5 + 0.5;
    vec2 rim = min(at.xy, 1.0 - at.xy);
    if (min(rim.x, rim.y) <= 0.0 || at.z >= 1.0) return 1.0;
    vec2 step_size = ahead.w / vec2(textureSize(shadow_map, 0));
    float lit = 0.0;
    int taps = int(care.x);
    for (int k = 0; k < taps; k++)
        lit += texture(shadow_map, vec3(at.xy + TAPS[k] * step_size, at.z - sun.w));
    return mix(1.0, lit / care.x, smoothstep(0.0, 0.04, min(rim.x, rim.y)));
}

vec3 sky(vec3 direction) {
    float height = max(direction.y, 0.0);
    vec3 colour = mix(HORIZON, vec3(0.16, 0.34, 0.78), pow(height, 0.5));
    float near_sun = max(dot(direction, sun.xyz), 0.0);
    return colour + vec3(1.0, 0.85, 0.6) * (0.25 * pow(near_sun, 12.0) + 6.0 * pow(near_sun, 1500.0));
}

vec3 hazy(vec3 colour, vec3 place) {
    float away = eye.w > 0.5 ? length(eye.xyz - place) : 0.0;
    return mix(colour, HORIZON, 1.0 - exp(-away * HAZE));
}

// The curve that Narkowicz fitted to the ACES film response.
vec4 displayed(vec3 light) {
    vec3 x = light * EXPOSURE;
    vec3 mapped = clamp(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 0.0, 1.0);
    return vec4(pow(mapped, vec3(1.0 / 2.2)), 1.0);
}

vec3 ambient(vec3 normal, float height) {
    vec3 light = mix(GROUND_LIGHT, SKY_LIGHT, 0.5 + 0.5 * normal.y);
    return light * mix(0.55, 1.0, clamp(height * 0.9, 0.0, 1.0));
}

// `sky_share`: how much of the light from around reaches the place.
vec3 lit(vec3 colour, float gloss, vec3 place, vec3 normal, float sky_share) {
    float facing = dot(normal, sun.xyz);
    float direct = facing > 0.0 ? facing * sunlight(place, normal) : 0.0;
    vec3 view = towards_eye(place);
    vec3 light = ambient(normal, place.y) * sky_share;
    float shine = pow(max(dot(normal, normalize(sun.xyz + view)), 0.0), 28.0) * gloss;
    float rim = pow(1.0 - max(dot(normal, view), 0.0), 4.0) * 0.16;
    return colour * (light + SUN_LIGHT * direct) + SUN_LIGHT * shine * direct + rim * light * (0.3 + colour);
}

vec3 lit(vec3 colour, float gloss, vec3 place, vec3 normal) {
    return lit(colour, gloss, place, normal, 1.0);
}
