// Edge-preserving upsampling of the cloud targets. CPU twin: src/reference/film.rs.
//
// A group's pixels share the texels around them: they are fetched once, into shared memory, and the logarithm of their
// distance is taken once. The includer declares `local_size_x = TILE_PIXELS.x` and `local_size_y = TILE_PIXELS.y`, and
// calls `load_tile` in uniform control flow before `upsample`.
#ifndef FILM_UPSAMPLE
#define FILM_UPSAMPLE

// Texels that a group of 16x8 pixels can reach at a downscale of 2 or more: floor((n - 1) / 2 · (1 + 1/17)) + 4.
const ivec2 TILE_PIXELS = ivec2(16, 8);
const ivec2 TILE_TEXELS = ivec2(12, 8);
shared vec4 tile_cloud[TILE_TEXELS.x * TILE_TEXELS.y];
shared float tile_log_distance[TILE_TEXELS.x * TILE_TEXELS.y];

// Catmull-Rom weights of the four samples around fraction f.
vec4 catmull_rom(float f) {
    float f2 = f * f, f3 = f2 * f;
    return vec4(-0.5 * f3 + f2 - 0.5 * f, 1.5 * f3 - 2.5 * f2 + 1.0, -1.5 * f3 + 2.0 * f2 + 0.5 * f, 0.5 * (f3 - f2));
}

float log_distance(float distance) {
    return log(max(distance, 1e-3));
}

// 1 where two distances agree, towards 0 where one is a tenth or more beyond the other; never 0, so that a pixel that
// agrees with no sample still gets their mean. `difference`: of the logarithms, absolute.
float agreement(float difference) {
    return max(exp(-30.0 * difference), 1e-4);
}

// Where a pixel's centre lies among the texels. Both images cover the whole view: equal relative coordinates see the
// same ray.
vec2 texel_position(ivec2 pixel, ivec2 size, ivec2 low_size) {
    return (vec2(pixel) + 0.5) / vec2(size) * vec2(low_size) - 0.5;
}

// The first texel that the group whose first pixel is `pixel` reaches.
ivec2 tile_origin(ivec2 pixel, ivec2 size, ivec2 low_size) {
    return ivec2(floor(texel_position(pixel, size, low_size))) - 1;
}

void load_tile(sampler2D cloud, sampler2D low_opaque, ivec2 origin, int local) {
    if (local < TILE_TEXELS.x * TILE_TEXELS.y) {
        ivec2 offset = ivec2(local % TILE_TEXELS.x, local / TILE_TEXELS.x);
        ivec2 texel = clamp(origin + offset, ivec2(0), textureSize(cloud, 0) - 1);
        tile_cloud[local] = texelFetch(cloud, texel, 0);
        tile_log_distance[local] = log_distance(texelFetch(low_opaque, texel, 0).x);
    }
    barrier();
}

// Where all sixteen texels agree with the pixel the filter is Catmull-Rom, limited to the range of the inner four so that
// it neither rings nor haloes; where some do not, it fades to a bilinear filter of those that do, whose weights are all
// positive. Exact where the weights are: a texel centre.
vec4 upsample(float distance, vec2 at, ivec2 origin) {
    vec2 base = floor(at), f = at - base;
    vec4 wx = catmull_rom(f.x), wy = catmull_rom(f.y);
    ivec2 first = ivec2(base) - 1 - origin;
    float log_pixel = log_distance(distance), worst = 0.0;
    vec4 sharp = vec4(0.0), least = vec4(3e38), greatest = vec4(-3e38);
    for (int y = 0; y < 4; ++y) {
        int row = (first.y + y) * TILE_TEXELS.x + first.x;
        vec4 line = vec4(0.0);
        for (int x = 0; x < 4; ++x) {
            vec4 value = tile_cloud[row + x];
            worst = max(worst, abs(tile_log_distance[row + x] - log_pixel));
            line += wx[x] * value;
            if (x > 0 && x < 3 && y > 0 && y < 3) {
                least = min(least, value);
                greatest = max(greatest, value);
            }
        }
        sharp += wy[y] * line;
    }
    sharp = clamp(sharp, least, greatest);
    float agreed = smoothstep(0.5, 0.9, agreement(worst));
    if (agreed == 1.0) return sharp;

    vec4 soft = vec4(0.0);
    float soft_weight = 0.0;
    for (int i = 0; i < 4; ++i) {
        ivec2 corner = ivec2(i & 1, i >> 1);
        int index = (first.y + 1 + corner.y) * TILE_TEXELS.x + first.x + 1 + corner.x;
        vec2 share = mix(1.0 - f, f, vec2(corner));
        float weight = share.x * share.y * agreement(abs(tile_log_distance[index] - log_pixel));
        soft += weight * tile_cloud[index];
        soft_weight += weight;
    }
    return mix(soft / soft_weight, sharp, agreed);
}

#endif
