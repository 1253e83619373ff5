#version 460
#extension GL_GOOGLE_include_directive : require
// Path tracing by null collisions (docs/reference.md). One thread a pixel; a step is one stretch of a ray in one cell of the
// grid, which ends at a wall or at a tentative event. All kinds of rays take the same steps, so neighbours in a subgroup
// stay together whatever their paths do, and a dispatch has as many steps as its time allows: paths go on in the next one.
//
// Extinction is the sum over overlapping particles, so a tentative event belongs to one of them, drawn in proportion to
// its greatest extinction; it is real with the probability that this particle's profile has there. Nothing else of the
// cell's list has to be evaluated.
#include "atmosphere/sky.glsl"
#include "common/frame.glsl"
#include "density/extinction.glsl"
#include "pathtrace/cells.glsl"
#include "pathtrace/path.glsl"
#include "pathtrace/random.glsl"
#include "pathtrace/scatter.glsl"
layout(local_size_x = 64) in;
layout(constant_id = 0) const uint HOMOGENEOUS = 0u;  // 1: density 1 all over each ellipsoid
layout(constant_id = 1) const uint EMISSION = 0u;     // 1: particles shine with their colour and do not scatter
layout(constant_id = 2) const uint SKY = 0u;          // light from all around: 0 none, 1 uniform, 2 the atmosphere's
layout(constant_id = 3) const uint ANALOGUE = 0u;     // 1: the estimator for tests: absorbed paths end, no rays to the sun
layout(constant_id = 4) const uint PHASE_FUNCTION = PHASE_CORNETTE_SHANKS;
layout(constant_id = 5) const uint ANTIALIAS = 0u;    // 1: rays are spread over the pixel; 0: through its centre

struct PathParams {
    vec3  uniform_sky;     // radiance from everywhere [W m⁻² sr⁻¹]
    float sky_altitude;    // at which the sky tables were filled [m]
    float sun_versine;     // 1 - cosine of the sun's angular radius; 0: a direction
    float g_single;        // asymmetry of the event that meets the sun
    float g_multiple;      // of all others
    float albedo;
    float detail;          // strength of the detail noise; 0: none
    uint  seed;
    uint  reserved_a;
    uint  reserved_b;
};

layout(binding = 0, std430) restrict readonly buffer Frame { FrameParams params; } frame;
layout(binding = 1, std430) restrict readonly buffer CellGridBuffer { CellParams params; } grid;
layout(binding = 2, std430) restrict readonly buffer CellCounts { uint count[]; } cell_counts;
layout(binding = 3, std430) restrict readonly buffer CellFirst { uint first[]; } cell_first;
layout(binding = 4, std430) restrict readonly buffer CellList { Cell cell[]; } cells;
layout(binding = 5, std430) restrict readonly buffer Entries { CellEntry entry[]; } entries;
layout(binding = 6, std430) restrict readonly buffer Particles { Particle elements[]; } particles;
layout(binding = 7, std430) restrict readonly buffer PathParamsBuffer { PathParams path; } params;
layout(binding = 8, std430) restrict readonly buffer Air { AirParams params; } air;
layout(binding = 9, std430) restrict readonly buffer Light { SkyLight params; } sky_light;
layout(binding = 10, std430) restrict buffer States { PathState state[]; } states;
layout(binding = 11, std430) restrict buffer Sums { PixelSums sums[]; } pixels;
layout(binding = 12, std430) restrict coherent buffer Activity { uint unfinished; } activity;
layout(binding = 13) uniform sampler3D detail_tile;
layout(binding = 14) uniform sampler3D profile_volume;
layout(binding = 15) uniform sampler2D sky_smooth;
layout(binding = 16) uniform sampler2D sky_aerosol;
layout(binding = 17) uniform sampler2D opaque_distance;
layout(push_constant) uniform TracePush {
    uint first_pixel;    // of the tile
    uint pixel_count;
    uint first_sample;   // of this pass
    uint samples;        // of each pixel in this pass
    uint steps;          // of this dispatch
    uint reserved;
} push;

// Below this transmittance a camera ray or a shadow ray is decided by chance, which is cheaper than carrying it on.
const float FAINT = 0.05;

PathState s;
uint pixel_index;

vec4 draw() { return unit_interval(pcg4d(uvec4(pixel_index, push.first_sample + s.sample_index, s.draws++, params.path.seed))); }

bool sun_shines() {
    return EMISSION == 0u && any(greaterThan(sky_light.params.sun_irradiance_clouds, vec3(0.0)));
}

// Reciprocal of a direction with no infinities: a ray along a wall never meets it.
vec3 inverse_of(vec3 dir) { return 1.0 / mix(dir, vec3(1e-12), lessThan(abs(dir), vec3(1e-12))); }

// From where to where the ray is in the grid; nothing if y <= x.
vec2 stretch_in_grid(vec3 origin, vec3 dir) {
    vec3 inverse = inverse_of(dir);
    vec3 a = (grid.params.least - origin) * inverse, b = (grid.params.greatest - origin) * inverse;
    vec3 near = min(a, b), far = max(a, b);
    return vec2(max(max(near.x, near.y), max(near.z, 0.0)), min(min(far.x, far.y), far.z));
}

void set_out(uint kind, vec3 origin, vec3 dir, float u) {
    s.kind = kind;
    s.origin = origin;
    s.dir = dir;
    s.t = 0.0;
    s.t_end = stretch_in_grid(origin, dir).y;
    s.tau = exponential(u);
}

vec3 sky_from(vec3 dir) {
    if (SKY == 0u) return vec3(0.0);
    if (SKY == 1u) return params.path.uniform_sky;
    float h = params.path.sky_altitude;
    if (hits_ground(air.params, h, dir.y)) return sky_light.params.ground_irradiance_clouds / AIR_PI;
    return sky_radiance(sky_smooth, sky_aerosol, air.params, h, dir, frame.params.to_sun);
}

// Sunlight of a path that leaves the scene along dir, where no rays are sent to the sun: part of the irradiance [1/sr].
// The event that meets the sun has a phase function of its own, but the path was turned by that of all others.
float sun_from(vec3 dir) {
    if (ANALOGUE == 0u || 1.0 - dot(dir, frame.params.to_sun) > params.path.sun_versine) return 0.0;
    float solid_angle = 6.283185307179586 * params.path.sun_versine;
    return phase(s.cos_last, params.path.g_single, PHASE_FUNCTION)
        / (phase(s.cos_last, params.path.g_multiple, PHASE_FUNCTION) * solid_angle);
}

void finish_sample() {
    vec3 radiance = s.light + s.sunlight * sky_light.params.sun_irradiance_clouds;
    PixelSums sums = pixels.sums[gl_GlobalInvocationID.x];
    add_sample(sums, radiance, s.clear, s.distance, float(push.first_sample + s.sample_index + 1u));
    pixels.sums[gl_GlobalInvocationID.x] = sums;
    s.sample_index += 1u;
    s.kind = FLIGHT_NONE;
}

void start_sample() {
    s.draws = 0u;
    s.events = 0u;
    s.light = vec3(0.0);
    s.sunlight = 0.0;
    s.transmittance = 1.0;
    s.clear = 1.0;
    s.scattered = 0.0;
    s.distance = 0.0;
    s.t_event = 0.0;
    uvec2 pixel = uvec2(pixel_index % frame.params.width, pixel_index / frame.params.width);
    vec4 u = draw();
    vec2 at = vec2(pixel) + (ANTIALIAS == 1u ? u.yz : vec2(0.5));
    vec3 dir = view_ray(frame.params, at, vec2(frame.params.width, frame.params.height));
    vec2 stretch = stretch_in_grid(frame.params.camera, dir);
    stretch.y = min(stretch.y, texelFetch(opaque_distance, ivec2(pixel), 0).x);
    if (stretch.y <= stretch.x) {
        finish_sample();
        return;
    }
    set_out(FLIGHT_CAMERA, frame.params.camera, dir, u.x);
    s.t = stretch.x;
    s.t_end = stretch.y;
}

// From the event at s.origin on into a direction drawn from the phase function.
void scatter() {
    float g = params.path.g_multiple;
    vec4 u = draw();
    float cosine = sample_henyey_greenstein(g, u.x);
    if (PHASE_FUNCTION == PHASE_CORNETTE_SHANKS) {
        // Cornette-Shanks is Henyey-Greenstein accepted with probability (1 + cos²) / 2: two draws in three at least.
        for (int i = 0; i < 64 && u.y >= 0.5 * (1.0 + cosine * cosine); ++i) {
            u = draw();
            cosine = sample_henyey_greenstein(g, u.x);
        }
    }
    s.cos_last = cosine;
    s.way = turned(s.way, 1.0 - cosine, u.z);
    set_out(FLIGHT_FREE, s.origin, s.way, u.w);
}

// The path has had an event at s.origin, which it reached along s.way.
void meet_event() {
    s.events += 1u;
    float albedo = params.path.albedo;
    if (ANALOGUE == 1u || albedo < 1.0) {
        vec4 u = draw();
        if (ANALOGUE == 1u) {
            if (u.x >= albedo) s.throughput = 0.0;
        } else {
            s.throughput *= albedo;
            if (s.throughput < 0.1 * s.scattered) s.throughput = u.x < 0.5 ? 2.0 * s.throughput : 0.0;
        }
        if (s.throughput <= 0.0) {
            finish_sample();
            return;
        }
    }
    if (ANALOGUE == 1u || !sun_shines()) {
        scatter();
        return;
    }
    vec4 u = draw();
    vec3 to_sun = frame.params.to_sun;
    if (params.path.sun_versine > 0.0) to_sun = turned(to_sun, u.x * params.path.sun_versine, u.y);
    s.transmittance = 1.0;
    set_out(FLIGHT_SHADOW, s.origin, to_sun, u.z);
}

void end_of_ray() {
    if (s.kind == FLIGHT_CAMERA) {
        s.clear = s.transmittance;
        if (EMISSION == 1u || s.scattered <= 0.0) {
            finish_sample();
            return;
        }
        s.origin += s.t_event * s.dir;
        s.way = s.dir;
        s.throughput = s.scattered;
        meet_event();
    } else if (s.kind == FLIGHT_SHADOW) {
        s.sunlight += s.throughput * s.transmittance * phase(dot(s.dir, s.way), params.path.g_single, PHASE_FUNCTION);
        scatter();
    } else {
        s.light += s.throughput * sky_from(s.dir);
        s.sunlight += s.throughput * sun_from(s.dir);
        finish_sample();
    }
}

// A tentative event of particle p that is real with this probability.
void tentative(Particle p, float real, vec2 u) {
    if (s.kind == FLIGHT_FREE) {
        if (u.x < real) {
            s.origin += s.t * s.dir;
            meet_event();
        }
        return;
    }
    bool faint = ANALOGUE == 1u || s.transmittance < FAINT;
    if (faint) real = u.x < real ? 1.0 : 0.0;
    float here = s.transmittance * real;
    s.transmittance -= here;
    if (s.kind == FLIGHT_CAMERA) {
        // One event is kept of all, each with its own probability; the rest is what gets through.
        s.distance += here * s.t;
        s.scattered += here;
        if (EMISSION == 1u) s.light += here * p.colour;
        if (here > 0.0 && u.y * s.scattered < here) s.t_event = s.t;
    }
    if (s.transmittance <= 0.0) end_of_ray();
}

float profile_at(Particle p, vec3 x) {
    vec3 p_us = to_unit_ball(p, vec4(x, 1.0));
    float r2 = dot(p_us, p_us);
    if (r2 >= 1.0) return 0.0;
    if (HOMOGENEOUS == 1u) return 1.0;
    vec3 n = r2 > 1e-12 ? p_us * inversesqrt(r2) : vec3(0.0, 1.0, 0.0);
    // The finest thing that the renderer shows there at full resolution.
    float far = distance(p.centre + rotate(p.rotation, n * p.semi_axes), frame.params.camera);
    float footprint = max(far * 2.0 * frame.params.tan_half_fov_y / float(frame.params.height), 1e-3);
    float radius = displaced_radius(p, n, frame.params.origin, detail_tile, params.path.detail, footprint);
    return r2 < radius * radius ? textureLod(profile_volume, p_us * (0.5 / radius) + 0.5, 0.0).x : 0.0;
}

void step_ray() {
    CellParams g = grid.params;
    vec3 x = s.origin + s.t * s.dir;
    ivec3 tops = ivec3(g.top_x, g.top_y, g.top_z);
    ivec3 top = cell_at(x - g.least, g.top_edge, tops);
    uint top_index = uint((top.z * tops.y + top.y) * tops.x + top.x);
    vec3 corner = g.least + vec3(top) * g.top_edge;
    float edge = g.top_edge;
    int n = split_of(cell_counts.count[top_index]);
    Cell cell = Cell(0u, 0u, 0.0, 0u);
    if (n > 0) {
        edge = g.top_edge / float(n);
        ivec3 sub = cell_at(x - corner, edge, ivec3(n));
        corner += vec3(sub) * edge;
        cell = cells.cell[cell_first.first[top_index] + uint((sub.z * n + sub.y) * n + sub.x)];
    }
    vec3 wall = (corner + mix(vec3(0.0), vec3(edge), greaterThan(s.dir, vec3(0.0))) - s.origin) * inverse_of(s.dir);
    // A little beyond the wall, where the lists of both cells hold, so that rounding cannot keep a ray in its cell.
    float t_wall = min(max(min(wall.x, min(wall.y, wall.z)), s.t) + 0.25 * g.slack, s.t_end);
    float tau_wall = cell.majorant * (t_wall - s.t);
    if (s.tau > tau_wall) {
        s.tau -= tau_wall;
        s.t = t_wall;
        if (s.t >= s.t_end) end_of_ray();
        return;
    }
    s.t += s.tau / cell.majorant;
    vec4 u = draw();
    s.tau = exponential(u.z);
    float chosen = u.w * cell.majorant;
    uint i = 0u;
    while (i + 1u < cell.count && entries.entry[cell.first + i].sum <= chosen) ++i;
    Particle p = particles.elements[entries.entry[cell.first + i].particle];
    tentative(p, profile_at(p, s.origin + s.t * s.dir), u.xy);
}

void main() {
    uint index = gl_GlobalInvocationID.x;
    if (index >= push.pixel_count) return;
    s = states.state[index];
    if (s.kind == FLIGHT_NONE && s.sample_index >= push.samples) return;
    pixel_index = push.first_pixel + index;
    for (uint i = 0u; i < push.steps; ++i) {
        if (s.kind == FLIGHT_NONE) {
            if (s.sample_index >= push.samples) break;
            start_sample();
        } else {
            step_ray();
        }
    }
    states.state[index] = s;
    if (s.kind != FLIGHT_NONE || s.sample_index < push.samples) atomicAdd(activity.unfinished, 1u);
}
