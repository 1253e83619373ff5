// Detail at run time (Yusov 5.4, "3D noise is used to add small details"): billow noise shrinks the particle's
// ellipsoid where the ray meets it, so that silhouettes break into bumps and the light follows them. The noise is
// anchored to the world, so overlapping particles share one surface.
#ifndef DETAIL_DISPLACE
#define DETAIL_DISPLACE

const float DETAIL_LACUNARITY = 2.37;    // ratio of successive wavelengths; irrational enough not to line up (tuned)
const float DETAIL_FIRST = 1.6;         // longest wavelength, in particle radii (tuned)
const float DETAIL_HEIGHT = 0.26;       // height of a bump, in wavelengths (tuned)
const int   DETAIL_OCTAVES = 4;
const float DETAIL_TILE_CELLS = 8.0;     // BILLOW_CELLS: wavelength = tile / cells

struct Detail {
    float depth;      // how far the surface lies below the ellipsoid [m]
    vec3  gradient;   // of that depth in world space [1]
};

// position: world point on the ellipsoid [m]; radius: of the particle [m]; footprint: width of a pixel there [m].
Detail surface_detail(sampler3D tile, vec3 position, float radius, float footprint) {
    // Wavelengths are powers of the lacunarity, the same for every particle; a particle uses those below its own size.
    float level = log(radius * DETAIL_FIRST) / log(DETAIL_LACUNARITY);
    float first = floor(level), blend = level - first;
    float wavelength = pow(DETAIL_LACUNARITY, first + 1.0);
    Detail detail = Detail(0.0, vec3(0.0));
    // What pixels cannot show fades away, from the shortest up.
    for (int octave = 0; octave <= DETAIL_OCTAVES && wavelength > 2.0 * footprint; ++octave) {
        // The longest fades in and the shortest out as the radius grows.
        float weight = octave == 0 ? blend : octave == DETAIL_OCTAVES ? 1.0 - blend : 1.0;
        weight *= clamp(wavelength / (2.0 * footprint) - 1.0, 0.0, 1.0);
        if (weight > 0.0) {
            // Each octave is turned and moved, or creases of all octaves would meet at the origin.
            float angle = 1.7 * (first + 1.0 - float(octave));
            vec2 turn = vec2(cos(angle), sin(angle));
            vec3 p = vec3(turn.x * position.x - turn.y * position.z, position.y, turn.y * position.x + turn.x * position.z);
            p = p / (wavelength * DETAIL_TILE_CELLS) + angle;
            vec4 n = textureLod(tile, p, 0.0);
            float height = DETAIL_HEIGHT * weight * wavelength;
            vec3 g = vec3(turn.x * n.x + turn.y * n.z, n.y, -turn.y * n.x + turn.x * n.z);
            detail.depth += height * (1.0 - n.w);
            detail.gradient -= height / wavelength * g;
        }
        wavelength /= DETAIL_LACUNARITY;
    }
    return detail;
}

#endif
