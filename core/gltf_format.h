// The numbers of the glTF 2.0 specification that its writer and its reader share.
#pragma once

#include <cstddef>
#include <cstdint>

namespace tsdfpp::gltf {

// Chapter 4, "GLB File Format Specification".
inline constexpr std::uint32_t kMagic = 0x46546C67;  // "glTF"
inline constexpr std::uint32_t kVersion = 2;
inline constexpr std::uint32_t kJsonChunk = 0x4E4F534A;    // "JSON"
inline constexpr std::uint32_t kBinaryChunk = 0x004E4942;  // "BIN"
inline constexpr std::size_t kHeaderBytes = 12;
inline constexpr std::size_t kChunkHeaderBytes = 8;

// accessor.componentType
inline constexpr int kInt8 = 5120;
inline constexpr int kUint8 = 5121;
inline constexpr int kInt16 = 5122;
inline constexpr int kUint16 = 5123;
inline constexpr int kUint32 = 5125;
inline constexpr int kFloat = 5126;

// bufferView.target
inline constexpr int kVertexTarget = 34962;
inline constexpr int kIndexTarget = 34963;

// An sRGB level as linear light, as which glTF keeps vertex colours; 65535 is 1.
std::uint16_t LinearLight(std::uint8_t level);

}  // namespace tsdfpp::gltf
