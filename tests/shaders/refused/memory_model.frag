// refused: VulkanMemoryModel
#version 460
#pragma use_vulkan_memory_model
layout(set = 0, binding = 0) buffer Store { uint count; } store;
layout(location = 0) out vec4 color;
void main() { color = vec4(store.count); }
