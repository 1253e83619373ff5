// Particles on screen tiles. Twin: src/blend/tiled.rs.
#ifndef BLEND_TILE_PARTICLE
#define BLEND_TILE_PARTICLE
#include "blend/ellipsoid.glsl"

const uint TILE = 8u;   // pixels along a side

// A visible particle as tiles see it. Pixels p of the image with q(p - middle) <= 1 may see it, others do not, where
// q(d) = conic.x d.x² + 2 conic.y d.x d.y + conic.z d.y².
struct TileParticle {
    vec2  middle;      // [pixels]; a pixel's centre is at ½
    uint  particle;
    float bound;       // no ray enters the particle before this distance [m]
    vec3  conic;       // 0: every pixel
    float reserved;
};

// Distances as keys of 16 bits that sort alike: 11 bits of mantissa above 1 m. Rounded down, so that a key is a bound, too.
uint distance_key(float metres) {
    return metres < 1.0 ? 0u : min((floatBitsToUint(metres) - floatBitsToUint(1.0)) >> 12, 0xffffu);
}
float key_distance(uint key) {
    return key == 0u ? 0.0 : uintBitsToFloat((key << 12) + floatBitsToUint(1.0));
}

// No point of the ellipsoid is nearer to the eye than its nearest plane across the line of sight to its centre. The slack
// covers the rounding of this and of the segments' ends.
float entry_bound(FrameParams frame, Particle p) {
    vec3 to_centre = p.centre - frame.camera;
    float away = length(to_centre);
    float reach = length(p.semi_axes * rotate_inverse(p.rotation, to_centre / max(away, 1e-6)));
    return away <= 1e-6 ? 0.0 : max(away - reach - 1e-5 * (away + reach), 0.0);
}

// The silhouette in pixels: the conic dual to D = c cᵀ - S, as in `screen_bounds`, has the middle (D13, D23) / D33 and the
// shape middle middleᵀ - D / D33, here expanded, since the difference cancels far away.
TileParticle tile_particle(FrameParams frame, Particle p, uint index, float bound) {
    vec3 relative = p.centre - frame.camera;
    vec3 c = vec3(dot(relative, frame.right), dot(relative, frame.up), dot(relative, frame.forward));
    vec3 ax = rotate_inverse(p.rotation, frame.right) * p.semi_axes;
    vec3 ay = rotate_inverse(p.rotation, frame.up) * p.semi_axes;
    vec3 az = rotate_inverse(p.rotation, frame.forward) * p.semi_axes;
    float sxx = dot(ax, ax), syy = dot(ay, ay), szz = dot(az, az);
    float sxy = dot(ax, ay), sxz = dot(ax, az), syz = dot(ay, az);
    float reach = sqrt(szz);
    vec2 size = vec2(frame.low_width, frame.low_height);
    TileParticle t = TileParticle(vec2(0.0), index, bound, vec3(0.0), 0.0);
    if (c.z - reach <= 1e-3 * reach) return t;   // reaches behind the eye
    float inverse = 1.0 / (c.z * c.z - szz);
    vec2 pixels = vec2(1.0, -1.0) * 0.5 * size / (frame.tan_half_fov_y * vec2(frame.aspect, 1.0));   // y runs down
    t.middle = vec2(c.x * c.z - sxz, c.y * c.z - syz) * inverse * pixels + 0.5 * size;
    float xx = c.z * c.z * sxx - 2.0 * c.x * c.z * sxz + c.x * c.x * szz + (sxz * sxz - sxx * szz);
    float yy = c.z * c.z * syy - 2.0 * c.y * c.z * syz + c.y * c.y * szz + (syz * syz - syy * szz);
    float xy = c.z * c.z * sxy - c.z * (c.x * syz + c.y * sxz) + c.x * c.y * szz + (sxz * syz - sxy * szz);
    vec3 shape = vec3(xx, xy, yy) * (inverse * inverse) * vec3(pixels.x * pixels.x, pixels.x * pixels.y, pixels.y * pixels.y);
    // Half a hundredth and a twentieth of a pixel of slack cover the rounding; the segments decide exactly.
    shape = shape * 1.01 + vec3(2.5e-3, 0.0, 2.5e-3);
    float determinant = max(shape.x * shape.z - shape.y * shape.y, 1e-6);
    t.conic = vec3(shape.z, -shape.y, shape.x) / determinant;
    return t;
}

float conic_at(vec3 conic, vec2 d) {
    return conic.x * d.x * d.x + 2.0 * conic.y * d.x * d.y + conic.z * d.y * d.y;
}

// First and last tile that the conic's bounding rectangle touches; empty (first > last) if it misses all.
ivec4 tile_range(TileParticle t, ivec2 tiles) {
    if (t.conic == vec3(0.0)) return ivec4(0, 0, tiles - 1);
    float determinant = t.conic.x * t.conic.z - t.conic.y * t.conic.y;
    vec2 half_size = sqrt(vec2(t.conic.z, t.conic.x) / determinant) * 1.001 + 0.01;
    vec2 first = floor((t.middle - half_size) / float(TILE)), last = floor((t.middle + half_size) / float(TILE));
    vec2 most = vec2(tiles);
    return ivec4(ivec2(clamp(first, vec2(0.0), most)), ivec2(clamp(last, vec2(-1.0), most - 1.0)));
}

// Whether any point of the tile's square lies in the conic: the least value of a convex form on a rectangle is at its
// middle, or on an edge that faces it.
bool touches(TileParticle t, ivec2 tile) {
    if (t.conic == vec3(0.0)) return true;
    vec2 low = vec2(tile) * float(TILE) - t.middle, high = low + float(TILE);
    vec2 nearest = clamp(vec2(0.0), low, high);
    if (nearest == vec2(0.0)) return true;
    float least = 1e30;
    if (nearest.x != 0.0) {
        float y = clamp(-t.conic.y / t.conic.z * nearest.x, low.y, high.y);
        least = conic_at(t.conic, vec2(nearest.x, y));
    }
    if (nearest.y != 0.0) {
        float x = clamp(-t.conic.y / t.conic.x * nearest.y, low.x, high.x);
        least = min(least, conic_at(t.conic, vec2(x, nearest.y)));
    }
    return least <= 1.0;
}

// Pixel of thread `lane` of a tile: eight neighbouring threads are a block of 4 x 2 pixels.
uvec2 tile_pixel(uint lane) {
    return uvec2((lane & 1u) | ((lane >> 1) & 2u) | ((lane >> 2) & 4u), ((lane >> 1) & 1u) | ((lane >> 2) & 2u) | ((lane >> 3) & 4u));
}

#endif
