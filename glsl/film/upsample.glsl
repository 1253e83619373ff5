// Edge-preserving upsampling of the cloud targets. CPU twin: src/reference/film.rs.
#ifndef FILM_UPSAMPLE
#define FILM_UPSAMPLE

// Catmull-Rom weights of the four samples around fraction f.
vec4 catmull_rom(float f) {
    float f2 = f * f, f3 = f2 * f;
    return vec4(-0.5 * f3 + f2 - 0.5 * f, 1.5 * f3 - 2.5 * f2 + 1.0, -1.5 * f3 + 2.0 * f2 + 0.5 * f, 0.5 * (f3 - f2));
}

// 1 where two distances agree, towards 0 where one is a tenth or more beyond the other; never 0, so that a pixel that
// agrees with no sample still gets their mean.
float agreement(float a, float b) {
    float ratio = abs(log(max(a, 1e-3) / max(b, 1e-3)));
    return max(exp(-30.0 * ratio), 1e-4);
}

vec4 upsample(sampler2D cloud, sampler2D low_opaque, sampler2D opaque_distance, ivec2 pixel, ivec2 size) {
    ivec2 low_size = textureSize(cloud, 0);
    // Both images cover the whole view: equal relative coordinates see the same ray.
    vec2 at = (vec2(pixel) + 0.5) / vec2(size) * vec2(low_size) - 0.5;
    vec2 base = floor(at);
    vec4 wx = catmull_rom(at.x - base.x), wy = catmull_rom(at.y - base.y);
    float distance = texelFetch(opaque_distance, pixel, 0).x;
    vec4 sum = vec4(0.0), least = vec4(3e38), greatest = vec4(-3e38);
    float weights = 0.0;
    for (int y = 0; y < 4; ++y) {
        for (int x = 0; x < 4; ++x) {
            ivec2 texel = clamp(ivec2(base) + ivec2(x, y) - 1, ivec2(0), low_size - 1);
            vec4 value = texelFetch(cloud, texel, 0);
            float agree = agreement(texelFetch(low_opaque, texel, 0).x, distance);
            float weight = wx[x] * wy[y] * agree;
            sum += weight * value;
            weights += weight;
            if (x > 0 && x < 3 && y > 0 && y < 3 && agree > 0.1) {
                least = min(least, value);
                greatest = max(greatest, value);
            }
        }
    }
    vec4 result = sum / max(weights, 1e-6);
    return least.x > greatest.x ? result : clamp(result, least, greatest);
}

#endif
