// From a column of cloud to its particles: size, place and orientation.
#ifndef WELKIN_GRID_SHAPE
#define WELKIN_GRID_SHAPE
#include "common/particle.glsl"
#include "grid/cell.glsl"

// a × b: rotate by b, then by a.
vec4 quaternion_multiply(vec4 a, vec4 b) {
    return vec4(a.w * b.xyz + b.w * a.xyz + cross(a.xyz, b.xyz), a.w * b.w - dot(a.xyz, b.xyz));
}

// Height of the cloud base at horizontal offset `from_camera` [m]: the layer follows the planet's curvature.
float base_height(vec2 from_camera, in GridParams p) {
    return p.altitude - dot(from_camera, from_camera) * p.inverse_diameter;
}

// Particle `layer` of the column, counted from its base. Rounding differs between devices only here and below, where
// no decision hangs on it.
Particle column_particle(CellPlace place, CellShape shape, uint layer, in GridParams p) {
    uint id = pcg(hash_lattice(place.absolute, p.seed + 16u + place.ring) + layer * 0x9e3779b9u);
    uint h0 = pcg(id), h1 = pcg(h0), h2 = pcg(h1), h3 = pcg(h2), h4 = pcg(h3), h5 = pcg(h4), h6 = pcg(h5);
    float edge = p.ring_frame[place.ring].z;
    float step = shape.height / float(shape.layers);
    float up = (float(layer) + 0.5) / float(shape.layers);

    // Narrow tops, wide bottoms; small at the outline. A layer's step is 0.9 of its particles' height.
    float taper = 1.0 - 0.42 * up * up;
    float outline = 0.55 + 0.45 * shape.body;
    float size = taper * outline * (0.85 + 0.35 * unit_float(h0));
    float across = edge * 0.74 * size;
    float tall = 0.5 * step / 0.9 * (0.95 + 0.3 * unit_float(h1));
    vec3 semi_axes = vec3(across * (0.88 + 0.24 * unit_float(h2)), max(tall, 0.35 * across), across);

    // Horizontal jitter ±0.4 cells, vertical ±0.15 of the height; the lowest layer stays near its plane.
    float jitter = layer == 0u ? 0.03 : 0.15;
    vec2 offset = vec2(signed_float(h3), signed_float(h4)) * (0.4 * edge);
    vec2 xz = place.centre + offset;
    float y = base_height(xz - p.camera.xz, p) + (float(layer) + 0.5) * step + signed_float(h5) * jitter * 2.0 * tall;

    // Random yaw, a random one of the three axes upright, a small tilt. Half-angle tangent in [-1, 1): every yaw, no
    // trigonometry.
    float t = signed_float(h6);
    vec4 yaw = vec4(0.0, 2.0 * t, 0.0, 1.0 - t * t) / (1.0 + t * t);
    vec4 tilt = normalize(vec4(0.16 * signed_float(pcg(h6)), 0.0, 0.16 * signed_float(pcg(h6 + 1u)), 1.0));
    vec4 rotation = quaternion_multiply(tilt, yaw);
    const float HALF_ROOT = 0.70710678;
    uint upright = h5 % 3u;
    if (upright == 1u) { // local z up: a quarter turn about x swaps y and z
        rotation = quaternion_multiply(rotation, vec4(HALF_ROOT, 0.0, 0.0, HALF_ROOT));
        semi_axes = semi_axes.xzy;
    } else if (upright == 2u) { // local x up: a quarter turn about z swaps x and y
        rotation = quaternion_multiply(rotation, vec4(0.0, 0.0, HALF_ROOT, HALF_ROOT));
        semi_axes = semi_axes.yxz;
    }

    Particle particle;
    particle.centre = vec3(xz.x, y, xz.y);
    particle.density = p.density * (0.35 + 0.65 * shape.body);
    particle.rotation = rotation;
    particle.semi_axes = semi_axes;
    particle.fade = shape.weight;
    particle.colour = vec3(1.0);
    particle.id = id;
    return particle;
}

#endif
