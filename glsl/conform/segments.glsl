// Segments for the checks of Welkin's own merge: as many rays, each with a segment for each layer.
#include "conform/layer.glsl"
#include "blend/merge.glsl"

struct ConformSegment {
    vec3 colour;
    float optical_depth;
    float t_enter;
    float t_exit;
    float reserved_a;
    float reserved_b;
};
layout(constant_id = 5) const uint RAYS = 1;       // pixels take turns with them
layout(constant_id = 6) const uint LAYERS = 1;     // segments of a ray
layout(binding = 1, std430) restrict readonly buffer Segments { ConformSegment elements[]; } segments;

// What layer `layer` puts in front of a pixel.
Segment segment_of(uint layer, ivec2 texel) {
    uint ray = (uint(texel.y) * push.stride + uint(texel.x)) % RAYS;
    ConformSegment s = segments.elements[ray * LAYERS + layer];
    float tau = is_lost(layer, texel) ? 0.0 : s.optical_depth;
    // For tests: all in one place, of one colour, so that the order does not matter.
    if (MERGE == MERGE_SUM) return Segment(vec3(1.0), tau, 1.0, 2.0);
    return Segment(s.colour, tau, s.t_enter, s.t_exit);
}
