// What one pixel's thread carries from dispatch to dispatch, and what it adds up. Twins: src/pathtrace/state.rs.
#ifndef PATHTRACE_PATH
#define PATHTRACE_PATH

// The ray that a path is flying along.
const uint FLIGHT_NONE = 0u;    // between two samples
const uint FLIGHT_CAMERA = 1u;  // from the eye, to the end of the scene, choosing the first event on the way
const uint FLIGHT_FREE = 2u;    // from one event to the next
const uint FLIGHT_SUN = 3u;     // from an event to the sun
const uint FLIGHT_SIDE = 4u;    // from an event towards where the next one would be well lit
const uint FLIGHT_SIDE_SUN = 5u; // from there to the sun

struct PathState {
    vec3  origin;        // of the ray, relative to the floating origin [m]
    float t;             // flown along it [m]
    vec3  dir;           // of the ray
    float t_end;         // where it leaves the scene [m]
    vec3  way;           // in which the path came to its last event
    float tau;           // left to the next tentative event, by the majorants [1]
    vec3  event;         // the path's last event, where it goes on when rays to the side have come home
    float pending;       // what the sun's ray brings home if nothing is in its way [1/sr]
    float transmittance; // of the way flown, camera and sun
    float throughput;    // of the path up to its last event
    float scattered;     // camera: probability that the ray has had an event
    float t_event;       // camera: the event chosen [m]
    vec3  light;         // what this sample has brought home: skylight, or emission [W m⁻² sr⁻¹]
    float sunlight;      // and sunlight, as part of the sun's irradiance [1/sr]
    float distance;      // camera: sum of probability × distance of tentative events [m]
    float clear;         // camera: the transmittance found
    float cos_last;      // of the angle of the last scattering
    uint  kind;          // FLIGHT_*
    uint  sample_index;  // in this pass
    uint  draws;         // random draws of this sample so far
    uint  events;        // scattering events of this sample so far
    float per_sunny;     // weight of this event's rays to the sun
    uint  sun_draw;      // point of the sun's disc that rays of this event aim at, two 16-bit numbers
};

// Means over a pixel's samples, with what the compensated sum carries, and sums of squared deviations (Welford 1962).
struct PixelSums {
    vec3  radiance;
    float transmittance;
    vec3  radiance_carry;
    float transmittance_carry;
    vec3  radiance_m2;        // Σ (x - mean)²
    float transmittance_m2;
    vec3  co_moment;          // Σ (radiance - mean) (transmittance - mean)
    float distance;           // mean of (1 - transmittance) × distance of the first event [m]
};

// One step of a compensated running mean (Kahan 1965): `precise` keeps compilers from simplifying it away.
void running_mean(inout float mean, inout float carry, float deviation, float n) {
    precise float step = deviation / n - carry;
    precise float next = mean + step;
    precise float taken = next - mean;
    carry = taken - step;
    mean = next;
}

void add_sample(inout PixelSums s, vec3 radiance, float transmittance, float distance, float n) {
    vec3 before = radiance - s.radiance;
    float before_t = transmittance - s.transmittance;
    for (int i = 0; i < 3; ++i) running_mean(s.radiance[i], s.radiance_carry[i], before[i], n);
    running_mean(s.transmittance, s.transmittance_carry, before_t, n);
    float after_t = transmittance - s.transmittance;
    s.radiance_m2 += before * (radiance - s.radiance);
    s.transmittance_m2 += before_t * after_t;
    s.co_moment += before * after_t;
    s.distance += (distance - s.distance) / n;
}

#endif
