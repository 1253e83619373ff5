// The view, the sun and the medium of one frame; written by the host. Twin: src/shared.rs.
#ifndef COMMON_FRAME
#define COMMON_FRAME

struct FrameParams {
    vec3  camera;           // [m], relative to the floating origin
    float tan_half_fov_y;   // tangent of half the vertical field of view
    vec3  right;            // unit basis of the view
    float aspect;           // width / height
    vec3  up;
    uint  width;            // full resolution [pixels]
    vec3  forward;
    uint  height;
    vec3  to_sun;           // unit direction towards the sun
    float sigma_t;          // extinction at relative density 1 [1/m]
    uint  low_width;        // resolution of the cloud targets [pixels]
    uint  low_height;
    uint  seed;
    float time;             // [s]
    vec3  origin;           // the floating origin in the scene's coordinates [m]: anchors the ground to the world
    float fill;             // mean of the density profile over a chord through the middle [1]
    vec3  detail_origin;    // what anchors the detail noise: the origin, less the way that the clouds have come [m]
    uint  reserved_c;
};

// Unit ray through `pixel` (texel units, centre of the first pixel at 0.5) of an image of `size`; row 0 is the top.
vec3 view_ray(FrameParams frame, vec2 pixel, vec2 size) {
    vec2 ndc = 2.0 * pixel / size - 1.0;
    return normalize(frame.forward + frame.tan_half_fov_y * (frame.aspect * ndc.x * frame.right - ndc.y * frame.up));
}

#endif
