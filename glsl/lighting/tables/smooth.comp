// Diffusion of light in the body of a cloud: a low-pass filter of the diffuse share of sunlight over a particle and its
// neighbours in the grid (above, below and eight around), weighted with their density, and the share of the sky that
// the particle sees. Yusov 5.3, step 3.
// Every layer has both its neighbours, layer 1 its lower one too (which Yusov's released code skips). A puff has the ball
// that carries it.
// Explicit particles have no neighbours in a grid: no smoothing.
#version 460
#extension GL_GOOGLE_include_directive : require
#include "grid/shape.glsl"
#include "grid/counters.glsl"
#include "compact/index.glsl"
#include "lighting/tables/sky.glsl"
layout(local_size_x = 64) in;

layout(set = 0, binding = 0, std430) readonly restrict buffer GridParamsBuffer { GridParams grid; } params;
layout(set = 0, binding = 1, std430) readonly restrict buffer CountersBuffer { Counters count; } counters;
layout(set = 0, binding = 2, std430) readonly restrict buffer Particles { Particle particle[]; } particles;
layout(set = 0, binding = 3, std430) readonly restrict buffer ParticleCells { uint cell_and_layer[]; } particle_cells;
layout(set = 0, binding = 4, std430) readonly restrict buffer CellShapes { vec4 shape[]; } cell_shapes;
layout(set = 0, binding = 5, std430) readonly restrict buffer CellFirst { uint first[]; } cell_first;
layout(set = 0, binding = 6, std430) readonly restrict buffer SunLight { ParticleLight at[]; } sun;
layout(set = 0, binding = 7, std430) writeonly restrict buffer ParticleLights { ParticleLight light[]; } particle_lights;
layout(push_constant) uniform SmoothPush {
    float smoothing;     // weight of a neighbour against 1 of the particle itself; 0: none
} push;

// Nothing is smoothed by default, and nothing read for it.
void add(uint slot, float share, inout vec3 weighted, inout float weights) {
    if (share <= 0.0 || slot >= counters.count.stored) return;
    float weight = share * particles.particle[slot].density * particles.particle[slot].fade;
    weighted += weight * sun.at[slot].diffuse;
    weights += weight;
}

void main() {
    uint index = linear_index();
    if (index >= counters.count.stored) return;
    uint packed_cell = particle_cells.cell_and_layer[index];
    ParticleLight light = sun.at[index];
    if (packed_cell != NO_CELL) {
        uint cell = packed_cell >> 5u, layer = packed_cell & 31u;
        uint dim = params.grid.ring_dim;
        ivec2 local = ivec2(int(cell % dim), int(cell / dim % dim));
        CellShape shape = unpack_shape(cell_shapes.shape[cell]);
        Particle particle = particles.particle[index];
        float height = particle.centre.y - base_height(particle.centre.xz - params.grid.camera.xz, params.grid);
        vec3 weighted = vec3(0.0);
        float weights = 0.0, open = 0.0;
        add(index, 1.0, weighted, weights);
        bool puff = layer >= shape.layers;
        if (puff) {
            layer = puff_host(particle.id, shape, cell / (dim * dim), params.grid);
            add(cell_first.first[cell] + layer, push.smoothing, weighted, weights);
        } else {
            if (layer > 0u) add(index - 1u, push.smoothing, weighted, weights);
            if (layer + 1u < shape.layers) add(index + 1u, push.smoothing, weighted, weights);
        }
        for (int dz = -1; dz <= 1; ++dz) {
            for (int dx = -1; dx <= 1; ++dx) {
                ivec2 other = local + ivec2(dx, dz);
                if (any(lessThan(other, ivec2(0))) || any(greaterThanEqual(other, ivec2(int(dim))))) {
                    open += sky_openness(shape.height - height); // beyond the ring: like here
                    continue;
                }
                uint neighbour = uint(int(cell) + dz * int(dim) + dx);
                CellShape there = unpack_shape(cell_shapes.shape[neighbour]);
                open += sky_openness(there.height - height);
                if (!puff && neighbour != cell && layer < there.layers) {
                    float share = dx == 0 || dz == 0 ? 1.0 : 0.5; // diagonals are farther away
                    add(cell_first.first[neighbour] + layer, share * push.smoothing, weighted, weights);
                }
            }
        }
        if (weights > 0.0) light.diffuse = weighted / weights;
        light.ambient = open / 9.0;
    }
    particle_lights.light[index] = light;
}
