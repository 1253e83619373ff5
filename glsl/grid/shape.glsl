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

// Steps of the ring's layers that a column reaches.
float column_steps(CellPlace place, CellShape shape, in GridParams p) {
    return shape.height * p.ring_layer[place.ring].y;
}

// How far a column leans at a share `up` of the layer's thickness [m].
vec2 column_lean(float up, in GridParams p) {
    if (p.lean_count < 2u) return vec2(0.0);
    float knots = clamp(up, 0.0, 1.0) * float(p.lean_count - 1u);
    uint knot = min(uint(knots), p.lean_count - 2u);
    vec4 a = p.lean[knot >> 1u], b = p.lean[(knot + 1u) >> 1u];
    return mix((knot & 1u) == 0u ? a.xy : a.zw, (knot & 1u) == 0u ? b.zw : b.xy, knots - float(knot));
}

// Of a column that grows, the top layer fades in as the column reaches it.
float layer_fade(CellPlace place, CellShape shape, uint layer, in GridParams p) {
    if (p.evolving == 0u || layer == 0u || layer + 1u < shape.layers) return 1.0;
    return clamp(column_steps(place, shape, p) - float(layer), 0.0, 1.0);
}

// A column's ball before it is turned: centre, and its half sizes across and upwards.
struct Ball {
    vec3 centre;
    float across;
    float tall;
    uint id;
    uint hash; // what is left of its randomness
};

// Ball `layer` of the column, counted from its base. Rounding differs between devices only here and below, where no
// decision hangs on it.
Ball column_ball(CellPlace place, CellShape shape, uint layer, in GridParams p) {
    Ball ball;
    ball.id = pcg(hash_lattice(place.absolute, p.seed + 16u + place.ring) + layer * 0x9e3779b9u);
    uint h0 = pcg(ball.id), h1 = pcg(h0), h2 = pcg(h1), h3 = pcg(h2), h4 = pcg(h3);
    ball.hash = pcg(h4);
    float edge = p.ring_frame[place.ring].z;
    float step = shape.height / float(shape.layers);
    float up = (float(layer) + 0.5) / float(shape.layers);
    if (p.evolving != 0u) { // layers keep their places while others come and go above them
        if (shape.layers > 1u) step = p.ring_layer[place.ring].x;
        up = min((float(layer) + 0.5) / max(column_steps(place, shape, p), 1.0), 1.0);
    }

    // Narrow tops, wide bottoms; small at the outline, and a few much larger than the others: billows of many sizes.
    // Neighbours overlap deeply, or the detail noise would open gaps between them.
    float taper = 1.0 - 0.42 * up * up;
    float outline = 0.62 + 0.38 * shape.body;
    float rare = float(h0 & 255u) / 256.0;
    float large = place.ring == 0u ? 1.1 * rare * rare * rare : 0.6 * rare * rare;
    float size = 0.62 + 0.4 * unit_float(h0) + large;
    ball.across = edge * 1.2 * taper * outline * size;
    // The lowest layer stays flat: its undersides are the cloud's base.
    float tall = max(0.62 * step, 0.8 * ball.across) * (0.9 + 0.25 * unit_float(h1));
    if (layer == 0u) tall = min(tall, 0.8 * step);
    ball.tall = tall;

    // Horizontal jitter ±0.4 cells, vertical ±0.15 of the height. The lowest layer stands on the base, near its plane.
    float jitter = layer == 0u ? 0.03 : 0.15;
    float up_metres = layer == 0u ? max(0.5 * step, 0.8 * tall) : (float(layer) + 0.5) * step;
    vec2 xz = place.centre + vec2(signed_float(h2), signed_float(h3)) * (0.4 * edge);
    float rise = up_metres + signed_float(h4) * jitter * 2.0 * tall;
    xz += column_lean(rise / p.thickness, p);
    float y = base_height(xz - p.camera.xz, p) + rise;
    ball.centre = vec3(xz.x, y, xz.y);
    return ball;
}

// Identity of the column's particle `index`: of puffs of columns that grow, one that does not depend on the layers.
uint column_id(CellPlace place, CellShape shape, uint index, in GridParams p) {
    if (p.evolving != 0u && index >= shape.layers) index += 24u - shape.layers; // LAYER_CAPACITY
    return pcg(hash_lattice(place.absolute, p.seed + 16u + place.ring) + index * 0x9e3779b9u);
}

// Puffs of columns that grow come and go with their host, and with the outline that has more of them.
float puff_fade(CellPlace place, CellShape shape, uint index, uint id, in GridParams p) {
    if (p.evolving == 0u) return 1.0;
    uint host = id % uint(p.ring_first[place.ring].z);
    if (host >= shape.layers) return 0.0;
    bool stays = index == shape.layers && (hash_lattice(place.absolute, p.seed + 15u) & 1u) == 1u;
    return layer_fade(place, shape, host, p) * (stays ? 1.0 : 1.0 - shape.body);
}

// A billow on the upper side of one of the column's balls: the top one well inside the cloud, any at the outline.
Ball puff_ball(CellPlace place, CellShape shape, uint index, in GridParams p) {
    uint id = column_id(place, shape, index, p);
    uint h0 = pcg(id), h1 = pcg(h0), h2 = pcg(h1), h3 = pcg(h2);
    Ball host = column_ball(place, shape, puff_host(id, shape, place.ring, p), p);
    vec3 side = normalize(vec3(signed_float(h0), 0.15 + unit_float(h1), signed_float(h2)));
    Ball ball;
    ball.id = id;
    ball.hash = pcg(h3);
    ball.across = host.across * (0.42 + 0.26 * unit_float(h3));
    ball.tall = ball.across * 0.9;
    ball.centre = host.centre + side * vec3(host.across, host.tall, host.across) * 0.82;
    return ball;
}

// Particle `index` of the column: its layers from the base up, then its puffs.
Particle column_particle(CellPlace place, CellShape shape, uint index, in GridParams p) {
    bool puff = index >= shape.layers;
    Ball ball;
    if (puff) ball = puff_ball(place, shape, index, p);
    else ball = column_ball(place, shape, index, p);
    uint h0 = ball.hash, h1 = pcg(h0), h2 = pcg(h1);
    vec3 semi_axes = vec3(ball.across * (0.88 + 0.24 * unit_float(h1)), ball.tall, ball.across);

    // Random yaw, a random one of the three axes upright, a small tilt. Half-angle tangent in [-1, 1): every yaw, no
    // trigonometry.
    float t = signed_float(h2);
    vec4 yaw = vec4(0.0, 2.0 * t, 0.0, 1.0 - t * t) / (1.0 + t * t);
    vec4 tilt = normalize(vec4(0.16 * signed_float(pcg(h2)), 0.0, 0.16 * signed_float(pcg(h2 + 1u)), 1.0));
    vec4 rotation = quaternion_multiply(tilt, yaw);
    const float HALF_ROOT = 0.70710678;
    uint upright = h0 % 3u;
    if (upright == 1u) { // local z up: a quarter turn about x swaps y and z
        rotation = quaternion_multiply(rotation, vec4(HALF_ROOT, 0.0, 0.0, HALF_ROOT));
        semi_axes = semi_axes.xzy;
    } else if (upright == 2u) { // local x up: a quarter turn about z swaps x and y
        rotation = quaternion_multiply(rotation, vec4(0.0, 0.0, HALF_ROOT, HALF_ROOT));
        semi_axes = semi_axes.yxz;
    }

    Particle particle;
    particle.centre = ball.centre;
    particle.density = p.density * (0.1 + 0.9 * shape.body * (0.4 + 0.6 * shape.body));
    particle.rotation = rotation;
    particle.semi_axes = semi_axes;
    float fade = puff ? puff_fade(place, shape, index, ball.id, p) : layer_fade(place, shape, index, p);
    particle.fade = shape.weight * fade;
    particle.colour = vec3(1.0);
    particle.id = ball.id;
    return particle;
}

#endif
