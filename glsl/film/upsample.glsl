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

// Where all sixteen texels agree with the pixel the filter is Catmull-Rom, limited to the range of the inner four so that
// it neither rings nor haloes; where some do not, it fades to a bilinear filter of those that do, whose weights are all
// positive. Exact where the weights are: a texel centre.
vec4 upsample(sampler2D cloud, sampler2D low_opaque, sampler2D opaque_distance, ivec2 pixel, ivec2 size) {
    ivec2 low_size = textureSize(cloud, 0);
    // Both images cover the whole view: equal relative coordinates see the same ray.
    vec2 at = (vec2(pixel) + 0.5) / vec2(size) * vec2(low_size) - 0.5;
    vec2 base = floor(at), f = at - base;
    vec4 wx = catmull_rom(f.x), wy = catmull_rom(f.y);
    float distance = texelFetch(opaque_distance, pixel, 0).x;
    vec4 sharp = vec4(0.0), soft = vec4(0.0), least = vec4(3e38), greatest = vec4(-3e38);
    float soft_weight = 0.0, worst = 1.0;
    for (int y = 0; y < 4; ++y) {
        for (int x = 0; x < 4; ++x) {
            ivec2 texel = clamp(ivec2(base) + ivec2(x, y) - 1, ivec2(0), low_size - 1);
            vec4 value = texelFetch(cloud, texel, 0);
            float agree = agreement(texelFetch(low_opaque, texel, 0).x, distance);
            worst = min(worst, agree);
            sharp += wx[x] * wy[y] * value;
            if (x > 0 && x < 3 && y > 0 && y < 3) {
                float weight = (x == 1 ? 1.0 - f.x : f.x) * (y == 1 ? 1.0 - f.y : f.y) * agree;
                soft += weight * value;
                soft_weight += weight;
                least = min(least, value);
                greatest = max(greatest, value);
            }
        }
    }
    return mix(soft / soft_weight, clamp(sharp, least, greatest), smoothstep(0.5, 0.9, worst));
}

#endif
