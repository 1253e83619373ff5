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
const uint SKY_NONE = 0u;
const uint SKY_UNIFORM = 1u;
const uint SKY_ATMOSPHERE = 2u;
layout(constant_id = 2) const uint SKY = SKY_NONE;    // light from all around
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
layout(binding = 12, std430) restrict coherent buffer Activity {
    uint unfinished;
    uint steps;
    uint events;
    uint tentative;
    uint real;           // quarters of an event
} activity;
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

// The same for all: read once, before any branch. (Lavapipe 26.1 faults where no lane of a subgroup is left to read them.)
FrameParams view;
CellParams cell_grid;
PathParams medium;
SkyLight lights;
AirParams clear_air;

#include "pathtrace/find.glsl"

PathState s;
uint pixel_index;
// In this dispatch.
uint events_met;
uint tentative_met;
float real_met; // of those, the part that was real

vec4 draw() { return unit_interval(pcg4d(uvec4(pixel_index, push.first_sample + s.sample_index, s.draws++, medium.seed))); }

bool sun_shines() {
    return EMISSION == 0u && any(greaterThan(lights.sun_irradiance_clouds, vec3(0.0)));
}

// From where to where the ray is in the grid; nothing if y <= x.
vec2 stretch_in_grid(vec3 origin, vec3 dir) {
    vec3 inverse = inverse_of(dir);
    vec3 a = (cell_grid.least - origin) * inverse, b = (cell_grid.greatest - origin) * inverse;
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
    if (SKY == SKY_NONE) return vec3(0.0);
    if (SKY == SKY_UNIFORM) return medium.uniform_sky;
    float h = medium.sky_altitude;
    if (hits_ground(clear_air, h, dir.y)) return lights.ground_irradiance_clouds / AIR_PI;
    return sky_radiance(sky_smooth, sky_aerosol, clear_air, h, dir, view.to_sun);
}

float phase_single(float cosine) { return phase(cosine, medium.g_single, PHASE_FUNCTION); }
float phase_multiple(float cosine) { return phase(cosine, medium.g_multiple, PHASE_FUNCTION); }

// The point of the sun that this event's rays aim at.
vec3 sun_drawn() {
    if (medium.sun_versine <= 0.0) return view.to_sun;
    vec2 u = (vec2(s.sun_draw & 0xffffu, s.sun_draw >> 16u) + 0.5) / 65536.0;
    return turned(view.to_sun, u.x * medium.sun_versine, u.y);
}

// Sunlight of a path that leaves the scene along dir, where no rays are sent to the sun: part of the irradiance [1/sr].
// The event that meets the sun has a phase function of its own, but the path was turned by that of all others.
float sun_from(vec3 dir) {
    if (ANALOGUE == 0u || 1.0 - dot(dir, view.to_sun) > medium.sun_versine) return 0.0;
    float solid_angle = 6.283185307179586 * medium.sun_versine;
    return phase_single(s.cos_last) / (phase_multiple(s.cos_last) * solid_angle);
}

// What happens when a ray has ended, in this order; each leads to a later one or to a new ray. Every piece of code stands
// once: CPU drivers run all of it for any lane.
const uint ACT_NONE = 0u;
const uint ACT_EVENT = 1u;    // the path has had an event at s.event, which it reached along s.way
const uint ACT_SIDE = 2u;     // from that event, a ray to the side
const uint ACT_SCATTER = 3u;  // from that event, on
const uint ACT_FINISH = 4u;   // the sample is complete
uint act;

void start_sample() {
    s.draws = 0u;
    s.events = 0u;
    s.light = vec3(0.0);
    s.sunlight = 0.0;
    s.transmittance = 1.0;
    s.scattered = 0.0;
    s.distance = 0.0;
    s.t_event = 0.0;
    s.clear = 1.0;
    uvec2 pixel = uvec2(pixel_index % view.width, pixel_index / view.width);
    vec4 u = draw();
    vec2 at = vec2(pixel) + (ANTIALIAS == 1u ? u.yz : vec2(0.5));
    vec3 dir = view_ray(view, at, vec2(view.width, view.height));
    vec2 stretch = stretch_in_grid(view.camera, dir);
    set_out(FLIGHT_CAMERA, view.camera, dir, u.x);
    s.t = stretch.x;
    s.t_end = min(stretch.y, texelFetch(opaque_distance, ivec2(pixel), 0).x);
}

// The ray of kind s.kind has ended, having had an event or not (`hit`).
void end_of_ray(bool hit) {
    vec3 here = s.origin + s.t * s.dir;
    if (s.kind == FLIGHT_CAMERA) {
        s.clear = s.transmittance;
        s.event = s.origin + s.t_event * s.dir;
        s.way = s.dir;
        s.throughput = s.scattered;
        act = EMISSION == 1u || s.scattered <= 0.0 ? ACT_FINISH : ACT_EVENT;
    } else if (s.kind == FLIGHT_FREE) {
        s.event = here;
        act = ACT_EVENT;
        if (!hit) {
            s.light += s.throughput * sky_from(s.dir);
            s.sunlight += s.throughput * sun_from(s.dir);
            act = ACT_FINISH;
        }
    } else if (s.kind == FLIGHT_SIDE && hit) {
        s.transmittance = 1.0;
        set_out(FLIGHT_SIDE_SUN, here, sun_drawn(), draw().x);
        act = ACT_NONE;
    } else {
        if (s.kind != FLIGHT_SIDE) s.sunlight += s.pending * s.transmittance;
        act = s.kind == FLIGHT_SUN ? ACT_SIDE : ACT_SCATTER;
    }
}

// Absorption, and whether rays go to the sun: straight to it, or to the side first.
void meet_event() {
    s.events += 1u;
    events_met += 1u;
    vec4 u = draw();
    act = ACT_SCATTER;
    if (ANALOGUE == 1u) {
        if (u.x >= medium.albedo) act = ACT_FINISH;
        return;
    }
    s.throughput *= medium.albedo;
    if (s.throughput < 0.1 * s.scattered) s.throughput = u.x < 0.5 ? 2.0 * s.throughput : 0.0;
    if (s.throughput <= 0.0) {
        act = ACT_FINISH;
        return;
    }
    vec3 corner;
    float edge, sunny = find_cell(s.event, corner, edge).sunny;
    if (!sun_shines() || u.y >= sunny) return;
    s.per_sunny = 1.0 / sunny;
    s.sun_draw = uint(u.z * 65536.0) | (uint(u.w * 65536.0) << 16u);
    vec3 to_sun = sun_drawn();
    float q = phase_single(dot(to_sun, s.way));
    s.pending = s.throughput * s.per_sunny * q;
    if (s.events > 1u) {
        float p = phase_multiple(s.cos_last);
        s.pending *= p / (p + q);
    }
    s.transmittance = 1.0;
    set_out(FLIGHT_SUN, s.event, to_sun, draw().x);
    act = ACT_NONE;
}

// A new direction: on from the path's event by the phase function, or to the side. The event after this one meets the sun
// with a phase function that peaks: its direction is drawn from that peak too, and both ways of drawing share the light by
// the balance heuristic (Veach and Guibas 1995). With p for the turn at this event and q for the one towards the sun at the
// next, either then brings p q / (p + q) home, which no peak of one alone can make large.
void leave_event() {
    vec4 u = draw();
    bool side = act == ACT_SIDE;
    float g = side ? medium.g_single : medium.g_multiple;
    float cosine = sample_henyey_greenstein(g, u.x);
    if (PHASE_FUNCTION == PHASE_CORNETTE_SHANKS) {
        // Cornette-Shanks is Henyey-Greenstein accepted with probability (1 + cos²) / 2: one draw in two at least.
        for (int i = 0; i < 64 && u.y >= 0.5 * (1.0 + cosine * cosine); ++i) {
            u = draw();
            cosine = sample_henyey_greenstein(g, u.x);
        }
    }
    vec3 dir = turned(side ? sun_drawn() : s.way, 1.0 - cosine, u.z);
    if (side) {
        float q = phase_single(cosine), p = phase_multiple(dot(s.way, dir));
        s.pending = s.throughput * s.per_sunny * medium.albedo * p * q / (p + q);
    } else {
        s.cos_last = cosine;
        s.way = dir;
    }
    set_out(side ? FLIGHT_SIDE : FLIGHT_FREE, s.event, dir, u.w);
}

void finish_sample() {
    vec3 radiance = s.light + s.sunlight * lights.sun_irradiance_clouds;
    PixelSums sums = pixels.sums[gl_GlobalInvocationID.x];
    add_sample(sums, radiance, s.clear, s.distance, float(push.first_sample + s.sample_index + 1u));
    pixels.sums[gl_GlobalInvocationID.x] = sums;
    s.sample_index += 1u;
    s.kind = FLIGHT_NONE;
}

float profile_at(Particle p, vec3 x) {
    vec3 p_us = to_unit_ball(p, vec4(x, 1.0));
    float r2 = dot(p_us, p_us);
    if (r2 >= 1.0) return 0.0;
    if (HOMOGENEOUS == 1u) return 1.0;
    vec3 n = r2 > 1e-12 ? p_us * inversesqrt(r2) : vec3(0.0, 1.0, 0.0);
    // The finest thing that the renderer shows there at full resolution.
    float far = distance(p.centre + rotate(p.rotation, n * p.semi_axes), view.camera);
    float footprint = max(far * 2.0 * view.tan_half_fov_y / float(view.height), 1e-3);
    float radius = displaced_radius(p, n, view.detail_origin, detail_tile, medium.detail, footprint);
    return r2 < radius * radius ? textureLod(profile_volume, p_us * (0.5 / radius) + 0.5, 0.0).x : 0.0;
}

// One stretch of the ray; whether it has ended.
bool step_ray(out bool hit) {
    hit = false;
    vec3 corner;
    float edge;
    Cell cell = find_cell(s.origin + s.t * s.dir, corner, edge);
    // A little beyond the wall, where the lists of both cells hold, so that rounding cannot keep a ray in its cell.
    float t_wall = min(max(wall_ahead(s.origin, s.dir, corner, edge), s.t) + 0.25 * cell_grid.slack, s.t_end);
    float tau_wall = cell.majorant * (t_wall - s.t);
    if (s.t >= s.t_end) return true; // a ray that misses the scene
    if (s.tau > tau_wall) {
        s.tau -= tau_wall;
        s.t = t_wall;
        return s.t >= s.t_end;
    }
    // A tentative event.
    s.t += s.tau / cell.majorant;
    vec4 u = draw();
    s.tau = exponential(u.z);
    float chosen = u.w * cell.majorant;
    uint i = cell.first, last = cell.first + cell.count - 1u; // the first whose sum is above what was chosen
    while (i < last) {
        uint middle = (i + last) / 2u;
        if (entries.entry[middle].sum <= chosen) i = middle + 1u; else last = middle;
    }
    Particle p = particles.elements[entries.entry[i].particle];
    float real = profile_at(p, s.origin + s.t * s.dir);
    tentative_met += 1u;
    real_met += real;
    if (s.kind == FLIGHT_FREE || s.kind == FLIGHT_SIDE) {
        hit = u.x < real;
        return hit;
    }
    if (ANALOGUE == 1u || s.transmittance < FAINT) real = u.x < real ? 1.0 : 0.0;
    float here = s.transmittance * real;
    s.transmittance -= here;
    if (s.kind == FLIGHT_CAMERA) {
        // One event is kept of all, each with its own probability; the rest is what gets through.
        s.distance += here * s.t;
        s.scattered += here;
        if (EMISSION == 1u) s.light += here * p.colour;
        if (here > 0.0 && u.y * s.scattered < here) s.t_event = s.t;
    }
    return s.transmittance <= 0.0;
}

// Steps between two looks at what has ended: rays of a subgroup end at different times.
const int STRIDE = 4;

void main() {
    view = frame.params;
    cell_grid = grid.params;
    medium = params.path;
    lights = sky_light.params;
    if (SKY == SKY_ATMOSPHERE) clear_air = air.params;
    uint index = gl_GlobalInvocationID.x;
    if (index >= push.pixel_count) return;
    s = states.state[index];
    if (s.kind == FLIGHT_NONE && s.sample_index >= push.samples) return;
    pixel_index = push.first_pixel + index;
    uint taken = 0u;
    events_met = 0u;
    tentative_met = 0u;
    real_met = 0.0;
    for (uint turn = 0u; turn < push.steps; ++turn) {
        if (s.kind == FLIGHT_NONE) {
            if (s.sample_index >= push.samples) break;
            start_sample();
        }
        taken += uint(STRIDE);
        bool ended = false, hit = false;
        for (int i = 0; i < STRIDE; ++i) {
            if (!ended) ended = step_ray(hit);
        }
        act = ACT_NONE;
        if (ended) end_of_ray(hit);
        if (act == ACT_EVENT) meet_event();
        if (act == ACT_SIDE || act == ACT_SCATTER) leave_event();
        if (act == ACT_FINISH) finish_sample();
    }
    states.state[index] = s;
    if (s.kind != FLIGHT_NONE || s.sample_index < push.samples) atomicAdd(activity.unfinished, 1u);
    atomicAdd(activity.steps, taken);
    atomicAdd(activity.events, events_met);
    atomicAdd(activity.tentative, tentative_met);
    atomicAdd(activity.real, uint(4.0 * real_met + 0.5));
}
