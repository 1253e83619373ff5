#version 460
#extension GL_GOOGLE_include_directive : require
// vertex: film/present.vert
// Puts a finished frame into an image of the host's, of whatever format a colour attachment can have. How it meets what
// is there is blend state.
#include "film/tonemap.glsl"
layout(constant_id = 0) const uint DECODE = 0;   // 1: undo the sRGB encoding, which the format applies again
layout(binding = 0) uniform sampler2D source;    // radiance and transmittance, or the toned picture
layout(location = 0) out vec4 colour;

void main() {
    colour = texelFetch(source, ivec2(gl_FragCoord.xy), 0);
    if (DECODE == 1) colour.rgb = vec3(srgb_decode(colour.r), srgb_decode(colour.g), srgb_decode(colour.b));
}
