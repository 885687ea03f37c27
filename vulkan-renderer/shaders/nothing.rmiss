// The miss shader. A ray that meets nothing leaves its search state unchanged.
#version 460
#extension GL_EXT_ray_tracing : require

layout(location = 0) rayPayloadInEXT uint payload;

void main() {
}
