#version 460
// Fills the optical depth table (Yusov 4.1): marches every ray through the sampled density.
// In: `volume`, density 0..1 over [-1, 1]³. Out: `table`, rg16f, mean density along the chord, distance to first matter.
// One invocation a texel, `steps` fetches each; the midpoint rule, whose error is below that of the sampled density.
#extension GL_GOOGLE_include_directive : require
#include "lut/optical_depth_lookup.glsl"

layout(local_size_x = 8, local_size_y = 8) in;
layout(binding = 0) uniform sampler3D volume;
layout(binding = 1, rg16f) restrict writeonly uniform image3D table;
layout(push_constant) uniform MarchPush { uint steps; uint homogeneous; };

// Mean density over the next step above which it counts as matter.
const float FIRST_MATTER = 0.1;

void main() {
    ivec3 texel = ivec3(gl_GlobalInvocationID), size = imageSize(table);
    if (any(greaterThanEqual(texel, size))) return;
    int n_theta = int(round(sqrt(float(size.y))));
    float phi_s = 2.0 * LUT_PI * (float(texel.x) + 0.5) / float(size.x);
    float phi_v = 2.0 * LUT_PI * (float(texel.z) + 0.5) / float(size.z);
    float theta_s = LUT_PI * float(texel.y % n_theta) / float(n_theta - 1);
    float theta_v = 0.5 * LUT_PI * float(texel.y / n_theta) / float(n_theta - 1);

    vec3 entry, e_theta, e_phi;
    lut_tangent_frame(theta_s, phi_s, entry, e_theta, e_phi);
    float cos_v = max(cos(theta_v), 0.0);
    vec3 dir = -cos_v * entry + sin(theta_v) * (cos(phi_v) * e_theta + sin(phi_v) * e_phi);
    float chord = 2.0 * cos_v;

    float sum = 0.0, first = 1.0, before = 0.0;
    if (homogeneous != 0u) {
        imageStore(table, texel, vec4(1.0, 0.0, 0.0, 0.0));  // also where the chord is nothing: the limit
        return;
    }
    for (uint k = 0u; k < steps; ++k) {
        float t = (float(k) + 0.5) / float(steps);
        float density = textureLod(volume, (entry + t * chord * dir) * 0.5 + 0.5, 0.0).x;
        sum += density;
        if (first == 1.0 && density > FIRST_MATTER) {
            // Where between the last two points it crossed the threshold.
            float back = (density - FIRST_MATTER) / max(density - before, 1e-6);
            first = clamp(t - back / float(steps), 0.0, 1.0);
        }
        before = density;
    }
    imageStore(table, texel, vec4(sum / float(steps), first, 0.0, 0.0));
}
