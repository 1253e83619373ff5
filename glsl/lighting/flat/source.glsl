// `flat`: each particle shines with its own constant colour.

vec3 source_radiance(Hit hit) {
    return hit.particle.colour;
}
