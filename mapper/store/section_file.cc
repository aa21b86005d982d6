#include "mapper/store/section_file.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <zlib.h>

#include <atomic>
#include <cstdlib>
#include <new>
#include <vector>

#include "core/limits.h"
#include "mapper/store/byte_stream.h"

namespace tsdfpp {
namespace {

constexpr std::string_view kMagic = "\x89TSDFM\r\n";  // what text modes and 7-bit channels break
constexpr std::uint32_t kByteOrder = 0x01020304;
constexpr std::uint32_t kOtherByteOrder = 0x04030201;
constexpr std::uint32_t kVersion = 1;
constexpr std::size_t kHeaderBytes = 32;  // magic, byte order, version, file's size, chunks, CRC
constexpr std::size_t kChunkHeaderBytes = 16;  // name, size, stored size, CRC
constexpr std::size_t kNameBytes = 4;
constexpr std::size_t kChunkBytes = 1U << 20U;
// 41 MB of the toy cars become 14.3 in 0.33 s of one core; level 6 takes twice as long for 13.7.
constexpr int kCompressionLevel = 1;

std::uint32_t Crc(std::string_view bytes, std::uint32_t before = 0) {
  return static_cast<std::uint32_t>(
      crc32_z(before, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

std::string Compressed(std::string_view bytes) {
  uLongf size = compressBound(static_cast<uLong>(bytes.size()));
  std::string packed(size, '\0');
  const int status = compress2(reinterpret_cast<Bytef*>(packed.data()), &size,
                               reinterpret_cast<const Bytef*>(bytes.data()),
                               static_cast<uLong>(bytes.size()), kCompressionLevel);
  if (status == Z_MEM_ERROR) throw std::bad_alloc();
  if (status != Z_OK) std::abort();  // there is no input that cannot be compressed
  packed.resize(size);
  return packed;
}

struct Chunk {
  std::string_view name;
  std::string_view bytes;  // raw before packing, stored before unpacking
  std::uint32_t raw_size = 0;
};

std::string PackChunk(const Chunk& chunk) {
  const std::string stored = Compressed(chunk.bytes);
  std::string packed(chunk.name);
  PutBytes(static_cast<std::uint32_t>(chunk.bytes.size()), packed);
  PutBytes(static_cast<std::uint32_t>(stored.size()), packed);
  PutBytes(Crc(stored, Crc(packed)), packed);
  return packed + stored;
}

// Checks all but the chunks; returns their number.
Expected<std::uint32_t> ReadHeader(std::string_view file, const std::string& where) {
  if (file.substr(0, kMagic.size()) != kMagic.substr(0, file.size()) || file.empty()) {
    return DataError("{}: is not a map file", where);
  }
  if (file.size() < kHeaderBytes) {
    return DataError("{}: is cut short, within its header", where);
  }
  ByteReader header(file.substr(kMagic.size(), kHeaderBytes - kMagic.size()));
  const auto order = header.Get<std::uint32_t>();
  const auto version = header.Get<std::uint32_t>();
  const auto size = header.Get<std::uint64_t>();
  const auto chunks = header.Get<std::uint32_t>();
  const auto crc = header.Get<std::uint32_t>();
  if (order == kOtherByteOrder) {
    return DataError("{}: was written by a machine of the other byte order", where);
  }
  if (order == kByteOrder && version > kVersion) {
    return DataError("{}: is a map file of version {}, expected {} or less", where, version,
                     kVersion);
  }
  if (crc != Crc(file.substr(0, kHeaderBytes - sizeof(crc)))) {
    return DataError("{}: is damaged, its header's checksum is wrong", where);
  }
  if (order != kByteOrder || version == 0) return DataError("{}: its header is wrong", where);
  if (file.size() != size) {
    return DataError("{}: is {}, {} bytes of {}", where,
                     file.size() < size ? "cut short" : "longer than it says", file.size(), size);
  }
  return chunks;
}

Expected<std::vector<Chunk>> ReadChunks(std::string_view file, std::uint32_t count,
                                        const std::string& where) {
  std::vector<Chunk> chunks;
  ByteReader reader(file.substr(kHeaderBytes));
  while (reader.left() > 0) {
    const std::string_view header = reader.Take(kChunkHeaderBytes);
    Chunk chunk;
    chunk.name = header.substr(0, std::min(kNameBytes, header.size()));
    ByteReader sizes(header.substr(chunk.name.size()));
    chunk.raw_size = sizes.Get<std::uint32_t>();
    const auto stored_size = sizes.Get<std::uint32_t>();
    const auto crc = sizes.Get<std::uint32_t>();
    chunk.bytes = reader.Take(stored_size);
    const bool whole = reader.ok() && sizes.ok() && chunk.raw_size <= kChunkBytes;
    if (!whole || crc != Crc(chunk.bytes, Crc(header.substr(0, kChunkHeaderBytes - sizeof(crc))))) {
      return DataError("{}: is damaged, the checksum of part {} of {} is wrong", where,
                       chunks.size() + 1, count);
    }
    chunks.push_back(chunk);
  }
  if (chunks.size() != count) {
    return DataError("{}: has {} parts, expected {}", where, chunks.size(), count);
  }
  return chunks;
}

}  // namespace

std::string PackSections(const Sections& sections) {
  std::vector<Chunk> chunks;
  for (const auto& [name, bytes] : sections) {
    if (name.size() != kNameBytes) std::abort();
    const std::string_view all(bytes);
    // An empty section has one empty chunk, so that its name is there.
    for (std::size_t at = 0; at == 0 || at < all.size(); at += kChunkBytes) {
      chunks.push_back({name, all.substr(at, kChunkBytes)});
    }
  }
  std::vector<std::string> packed(chunks.size());
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, chunks.size(), 1),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) packed[i] = PackChunk(chunks[i]);
      },
      tbb::simple_partitioner());
  std::size_t size = kHeaderBytes;
  for (const std::string& chunk : packed) size += chunk.size();
  std::string file(kMagic);
  file.reserve(size);
  PutBytes(kByteOrder, file);
  PutBytes(kVersion, file);
  PutBytes(static_cast<std::uint64_t>(size), file);
  PutBytes(static_cast<std::uint32_t>(packed.size()), file);
  PutBytes(Crc(file), file);
  for (const std::string& chunk : packed) file += chunk;
  return file;
}

Expected<Sections> UnpackSections(std::string_view file, const std::string& where) {
  TSDFPP_ASSIGN(const std::uint32_t count, ReadHeader(file, where));
  TSDFPP_ASSIGN(const std::vector<Chunk> chunks, ReadChunks(file, count, where));
  // What the parts unfold to is known before any memory is taken for it: a part of zeros takes a
  // thousandth of its size.
  std::int64_t unfolded = 0;
  Sections sections;
  std::map<std::string_view, std::size_t> sizes;
  std::vector<std::size_t> places(chunks.size());  // of each part in its section
  for (std::size_t i = 0; i < chunks.size(); ++i) {
    unfolded += chunks[i].raw_size;
    std::size_t& size = sizes[chunks[i].name];
    places[i] = size;
    size += chunks[i].raw_size;
  }
  TSDFPP_RETURN_IF_ERROR(
      CheckLimit(&Limits::map_bytes, unfolded, where, "bytes of a map once it is unfolded"));
  for (const auto& [name, size] : sizes) sections[std::string(name)].resize(size);
  std::vector<std::string*> texts(chunks.size());
  for (std::size_t i = 0; i < chunks.size(); ++i) {
    texts[i] = &sections[std::string(chunks[i].name)];
  }
  std::atomic<bool> good = true;
  tbb::parallel_for(
      tbb::blocked_range<std::size_t>(0, chunks.size(), 1),
      [&](const tbb::blocked_range<std::size_t>& range) {
        for (std::size_t i = range.begin(); i != range.end(); ++i) {
          uLongf size = chunks[i].raw_size;
          char* to = texts[i]->data() + places[i];
          const int status = uncompress(reinterpret_cast<Bytef*>(to), &size,
                                        reinterpret_cast<const Bytef*>(chunks[i].bytes.data()),
                                        static_cast<uLong>(chunks[i].bytes.size()));
          if (status != Z_OK || size != chunks[i].raw_size) good = false;
        }
      },
      tbb::simple_partitioner());
  if (!good) return DataError("{}: holds compressed data that cannot be unpacked", where);
  return sections;
}

}  // namespace tsdfpp
