// refused: FragmentShaderPixelInterlockEXT
#version 460
#extension GL_ARB_fragment_shader_interlock : require
layout(pixel_interlock_ordered) in;
layout(set = 0, binding = 0, rgba8) uniform image2D image;
layout(location = 0) out vec4 color;
void main() {
    beginInvocationInterlockARB();
    imageStore(image, ivec2(0), vec4(1.0));
    endInvocationInterlockARB();
    color = vec4(1.0);
}
