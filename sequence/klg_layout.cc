#include "sequence/klg_layout.h"

#include <zlib.h>

#include <array>
#include <cstring>
#include <fstream>
#include <new>

namespace tsdfpp {
namespace {

template <typename T>
bool Take(std::istream& in, T& value) {
  std::array<char, sizeof(T)> bytes{};
  if (!in.read(bytes.data(), bytes.size())) return false;
  std::memcpy(&value, bytes.data(), sizeof(T));
  return true;
}

}  // namespace

Expected<KlgIndex> ReadKlgIndex(const std::filesystem::path& path) {
  std::error_code code;
  const auto size = std::filesystem::file_size(path, code);
  std::ifstream in(path, std::ios::binary);
  if (code || !in) return DataError("{}: cannot be read", path.string());
  std::int32_t count = 0;
  if (!Take(in, count)) {
    return DataError("{}: {} bytes, expected a frame count of 4 bytes and frames", path.string(),
                     size);
  }
  if (count <= 0) {
    return DataError(
        "{}: the frame count is {}, expected one over 0 (was the recording stopped "
        "before it was finished?)",
        path.string(), count);
  }
  KlgIndex index;
  std::uint64_t at = sizeof(count);
  for (std::int32_t i = 0; i < count; ++i) {
    KlgEntry entry;
    std::int32_t depth_bytes = 0;
    std::int32_t colour_bytes = 0;
    if (!Take(in, entry.time_us) || !Take(in, depth_bytes) || !Take(in, colour_bytes)) {
      return DataError("{}: cut short in the header of frame {} of {}, at byte {}", path.string(),
                       i, count, size);
    }
    at += sizeof(entry.time_us) + sizeof(depth_bytes) + sizeof(colour_bytes);
    if (depth_bytes <= 0 || colour_bytes <= 0) {
      return DataError(
          "{}: frame {} of {} has {} bytes of depth and {} of colour, expected both "
          "over 0",
          path.string(), i, count, depth_bytes, colour_bytes);
    }
    entry.depth_offset = at;
    entry.depth_bytes = static_cast<std::uint32_t>(depth_bytes);
    entry.colour_bytes = static_cast<std::uint32_t>(colour_bytes);
    const std::uint64_t need = std::uint64_t{entry.depth_bytes} + entry.colour_bytes;
    if (at + need > size) {
      return DataError("{}: cut short in frame {} of {}: it needs {} bytes, {} are left",
                       path.string(), i, count, need, size - at);
    }
    if (!index.entries.empty() && entry.time_us <= index.entries.back().time_us) {
      return DataError("{}: the time of frame {} is {} us, not after that of the frame before, {}",
                       path.string(), i, entry.time_us, index.entries.back().time_us);
    }
    index.entries.push_back(entry);
    at += need;
    in.seekg(static_cast<std::streamoff>(at));
  }
  index.bytes_after = size - at;
  return index;
}

Expected<std::string> Inflate(const std::string& bytes, std::size_t expected_bytes,
                              const std::string& what) {
  // One byte more shows what would be too long.
  std::string unpacked(expected_bytes + 1, '\0');
  uLongf size = unpacked.size();
  const int status =
      uncompress(reinterpret_cast<Bytef*>(unpacked.data()), &size,
                 reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uLong>(bytes.size()));
  if (status == Z_BUF_ERROR && size == unpacked.size()) size = expected_bytes + 1;
  if (status != Z_OK && !(status == Z_BUF_ERROR && size > expected_bytes)) {
    return DataError("{}: cannot be unpacked by zlib", what);
  }
  if (size != expected_bytes) {
    return DataError("{}: unpacks to {} bytes, expected {} (16 bits a pixel)", what,
                     size > expected_bytes ? "more" : fmt::format("{}", size), expected_bytes);
  }
  unpacked.resize(expected_bytes);
  return unpacked;
}

std::string Deflate(const std::string& bytes) {
  uLongf size = compressBound(static_cast<uLong>(bytes.size()));
  std::string packed(size, '\0');
  const int status = compress2(reinterpret_cast<Bytef*>(packed.data()), &size,
                               reinterpret_cast<const Bytef*>(bytes.data()),
                               static_cast<uLong>(bytes.size()), Z_BEST_SPEED);
  if (status != Z_OK) throw std::bad_alloc();  // there is no input that cannot be compressed
  packed.resize(size);
  return packed;
}

}  // namespace tsdfpp
