// With one sample per pixel, the centroid and the sample are the pixel's centre.
#version 460
layout(location = 0) in vec2 uv;
layout(location = 0) out vec4 color;
void main() { color = vec4(interpolateAtCentroid(uv), interpolateAtSample(uv, 0)); }
