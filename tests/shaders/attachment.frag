#version 460
layout(input_attachment_index = 0, set = 0, binding = 4) uniform subpassInput previous;
layout(input_attachment_index = 1, set = 0, binding = 5) uniform subpassInputMS samples;
layout(input_attachment_index = 2, set = 0, binding = 6) uniform usubpassInput ids;
layout(location = 0) out vec4 color;
void main() { color = subpassLoad(previous) + subpassLoad(samples, 1) + subpassLoad(ids); }
