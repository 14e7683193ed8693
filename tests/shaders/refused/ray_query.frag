// refused: AccelerationStructure
#version 460
#extension GL_EXT_ray_query : require
layout(set = 0, binding = 0) uniform accelerationStructureEXT scene;
layout(location = 0) out vec4 color;
void main() {
    rayQueryEXT query;
    rayQueryInitializeEXT(query, scene, 0u, 0xff, vec3(0.0), 0.0, vec3(1.0), 1.0);
    color = vec4(rayQueryProceedEXT(query));
}
