// Longer than most files: one class, with a way to change each form of file.
#include "tests/fuzz/mutate.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <nlohmann/json.hpp>
#include <vector>

#include "core/gltf_format.h"
#include "mapper/store/byte_stream.h"
#include "mapper/store/section_file.h"
#include "sequence/klg_layout.h"
#include "tests/fuzz/file_set.h"

namespace tsdfpp::fuzz {
namespace {

using nlohmann::json;

constexpr std::array kWords{"0",
                            "-0",
                            "1",
                            "-1",
                            "2",
                            "255",
                            "256",
                            "65534",
                            "65535",
                            "65536",
                            "1e-300",
                            "1e300",
                            "-1e9",
                            "1e6",
                            "0.001",
                            "0.5",
                            "2147483647",
                            "-2147483648",
                            "4294967296",
                            "9223372036854775807",
                            "18446744073709551615",
                            "nan",
                            "inf",
                            "-inf",
                            "true",
                            "null",
                            "[]",
                            "{}",
                            "\"\"",
                            "\"..\"",
                            "\"../x\"",
                            "\"a/b\"",
                            "\"/dev/zero\"",
                            "\"con\"",
                            "[[1, 2], [3]]",
                            "[0.0, 0.0, 1.0]",
                            "#",
                            "x"};

json SomeJson(std::size_t which) {
  constexpr std::int64_t kWhole[] = {0,          1,          -1,    2,
                                     255,        65535,      65536, 2147483647,
                                     4294967295, 1000000001, -5,    9223372036854775807,
                                     -2147483648};
  switch (which % 8) {
    case 0:
      return nullptr;
    case 1:
      return which % 16 < 8;
    case 2:
    case 3:
      return kWhole[which / 8 % std::size(kWhole)];
    case 4: {
      constexpr double kReal[] = {0.5, -1.5, 1e300, -1e300, 1e-300, 1e18, 4294967296.5, -0.0};
      return kReal[which / 8 % std::size(kReal)];
    }
    case 5: {
      const char* const kText[] = {"",        "..", "../a", "/etc/passwd", "a/b",
                                   "x",       "00", "1",    "\n",          "\xc2\x80",
                                   "con.txt", "-1", "a ",   "tsdf++",      "99999999999"};
      return kText[which / 8 % std::size(kText)];
    }
    case 6:
      return json::array();
    default:
      return json::object();
  }
}

// The place after this many others, in order of the text.
json* PlaceAt(json& value, std::size_t& left) {
  if (left == 0) return &value;
  --left;
  if (!value.is_structured()) return nullptr;
  for (json& child : value) {
    if (json* const found = PlaceAt(child, left)) return found;
  }
  return nullptr;
}

std::size_t CountPlaces(const json& value) {
  std::size_t count = 1;
  if (value.is_structured()) {
    for (const json& child : value) count += CountPlaces(child);
  }
  return count;
}

bool EndsWithAny(std::string_view name, std::initializer_list<std::string_view> endings) {
  return std::any_of(endings.begin(), endings.end(),
                     [&](std::string_view ending) { return name.ends_with(ending); });
}

std::uint32_t Crc32(std::string_view bytes) {
  return static_cast<std::uint32_t>(
      crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

std::string BigEndian(std::uint32_t value) {
  std::string bytes;
  for (int shift = 24; shift >= 0; shift -= 8) bytes += static_cast<char>(value >> shift & 0xFFU);
  return bytes;
}

}  // namespace

std::string Mutator::SomeWord() { return kWords[Below(kWords.size())]; }

std::string Mutator::ChangePath(const std::string& path) {
  std::string changed = path;
  const std::size_t digit = changed.find_last_of("0123456789");
  if (digit != std::string::npos && !OneIn(4)) {
    changed[digit] = static_cast<char>('0' + Below(10));
  } else if (!changed.empty()) {
    constexpr std::string_view kBytes = "\n\x01\xff-. a~";
    changed.insert(Below(changed.size() + 1), 1, kBytes[Below(kBytes.size())]);
  }
  return changed;
}

// By words or by lines.
std::string Mutator::ChangeText(const std::string& text) {
  std::string changed = text;
  constexpr std::string_view kBetween = " \t\n,=[]{}\"'";
  switch (Below(6)) {
    case 0:
    case 1: {  // another word
      const std::size_t at = text.find_first_not_of(kBetween, Below(text.size() + 1));
      if (at == text.npos) break;
      const std::size_t end = std::min(text.find_first_of(kBetween, at), text.size());
      return changed.replace(at, end - at, SomeWord());
    }
    case 2: {  // one more word
      const std::size_t at = text.find_first_of(kBetween, Below(text.size() + 1));
      return changed.insert(std::min(at, text.size()), " " + SomeWord());
    }
    case 3:
    case 4: {  // a line twice, elsewhere, or gone
      const std::size_t somewhere = Below(text.size() + 1);
      const std::size_t before = somewhere == 0 ? text.npos : text.rfind('\n', somewhere - 1);
      const std::size_t begin = before == text.npos ? 0 : before + 1;
      const std::size_t end = std::min(text.find('\n', begin), text.size() - 1) + 1;
      if (begin >= text.size()) break;
      const std::string line = text.substr(begin, end - begin);
      const bool twice = OneIn(2);
      if (!twice) changed.erase(begin, end - begin);
      if (!twice && OneIn(2)) return changed;
      const std::size_t place = changed.find('\n', Below(changed.size() + 1));
      return changed.insert(place == changed.npos ? 0 : place + 1, line);
    }
    default:
      break;
  }
  return change_bytes_(text);
}

std::string Mutator::ChangeJson(const std::string& text) {
  json root = json::parse(text, nullptr, false);
  if (root.is_discarded() || OneIn(16)) return ChangeText(text);
  const std::size_t places = CountPlaces(root);
  std::size_t left = Below(places);
  json& place = *PlaceAt(root, left);
  std::size_t other = Below(places);
  const json copy = *PlaceAt(root, other);
  const auto any_child = [&] {
    return std::next(place.begin(), static_cast<long>(Below(place.size())));
  };
  const std::size_t kind = Below(8);
  if (place.is_object() && !place.empty() && kind < 4) {
    const auto child = any_child();
    const std::string key = child.key();
    const json value = child.value();
    if (kind == 0) place.erase(key);
    if (kind == 1) place[key] = SomeJson(random_());
    if (kind == 2) place[ChangePath(key)] = value;
    if (kind == 3) place[key] = copy;
  } else if (place.is_array() && !place.empty() && kind < 4) {
    const auto child = any_child();
    if (kind == 0) {
      place.erase(child);
    } else if (kind == 1) {
      place.push_back(json(*child));
    } else {
      *child = kind == 2 ? SomeJson(random_()) : copy;
    }
  } else if (place.is_number_integer() && kind < 6) {
    place = static_cast<std::int64_t>(place.get<std::uint64_t>() + Below(5) - 2);
  } else if (place.is_number_float() && kind < 6) {
    place = place.get<double>() * (OneIn(2) ? -1 : 1.5);
  } else if (place.is_string() && kind < 6) {
    place = ChangePath(place.get<std::string>());
  } else {
    place = kind == 7 ? copy : SomeJson(random_());
  }
  constexpr std::size_t kMostPlaces = 3000;
  if (CountPlaces(root) > kMostPlaces) return ChangeText(text);
  return root.dump(-1, ' ', false, json::error_handler_t::replace);
}

std::string Mutator::ChangeMap(const std::string& bytes) {
  auto sections = UnpackSections(bytes, "map");
  if (!sections || sections->empty() || OneIn(16)) return change_bytes_(bytes);
  const auto section = std::next(sections->begin(), static_cast<long>(Below(sections->size())));
  std::string& content = section->second;
  if (OneIn(32)) {
    sections->erase(section);
  } else if (section->first == "CONF") {
    content = ChangeText(content);
  } else if (content.size() >= 4 && OneIn(2)) {
    // A number of the section: counts, indices and ids are whole ones.
    const std::size_t size = std::size_t{1} << Below(3);
    constexpr std::uint32_t kNumbers[] = {0,          1,          2,          0x7FFF,
                                          0xFFFF,     0x10000,    0xFFFFF,    0x7FFFFFFF,
                                          0x80000000, 0xFFFFFFFF, 0x7F800000, 0x7FC00000};
    std::uint32_t number = kNumbers[Below(std::size(kNumbers))];
    const std::size_t at = Below(content.size() / size) * size;
    if (OneIn(2)) {
      std::memcpy(&number, content.data() + at, std::min(size, content.size() - at));
      number += static_cast<std::uint32_t>(Below(5)) - 2;
    }
    std::memcpy(content.data() + at, &number, std::min(size, content.size() - at));
  } else {
    content = change_bytes_(content);
  }
  return PackSections(*sections);
}

std::string Mutator::ChangeGlb(const std::string& bytes) {
  ByteReader reader(bytes);
  (void)reader.Get<std::uint32_t>();
  const auto version = reader.Get<std::uint32_t>();
  (void)reader.Get<std::uint32_t>();
  std::vector<std::pair<std::uint32_t, std::string>> chunks;
  while (reader.left() >= gltf::kChunkHeaderBytes) {
    const auto size = reader.Get<std::uint32_t>();
    const auto type = reader.Get<std::uint32_t>();
    chunks.emplace_back(type, std::string(reader.Take(size)));
  }
  if (!reader.ok() || chunks.empty() || OneIn(16)) return change_bytes_(bytes);
  auto& [type, content] = chunks[Below(OneIn(4) ? chunks.size() : 1)];
  content = type == gltf::kJsonChunk ? ChangeJson(content) : change_bytes_(content);
  std::string body;
  for (auto& [chunk_type, chunk] : chunks) {
    while (chunk.size() % 4 != 0) chunk += chunk_type == gltf::kJsonChunk ? ' ' : '\0';
    PutBytes(static_cast<std::uint32_t>(chunk.size()), body);
    PutBytes(chunk_type, body);
    body += chunk;
  }
  std::string packed;
  PutBytes(gltf::kMagic, packed);
  PutBytes(version, packed);
  PutBytes(static_cast<std::uint32_t>(gltf::kHeaderBytes + body.size()), packed);
  return packed + body;
}

// A frame's depth is unpacked, changed and packed; or the headers are changed.
std::string Mutator::ChangeKlg(const std::string& bytes) {
  struct KlgFrame {
    std::int64_t time_us;
    std::string depth;
    std::string colour;
  };
  ByteReader reader(bytes);
  auto count = reader.Get<std::int32_t>();
  std::vector<KlgFrame> frames;
  constexpr std::size_t kMostFrames = 20;
  while (reader.left() > 0 && frames.size() < kMostFrames) {
    const auto time_us = reader.Get<std::int64_t>();
    const auto depth_bytes = reader.Get<std::uint32_t>();
    const auto colour_bytes = reader.Get<std::uint32_t>();
    std::string depth(reader.Take(depth_bytes));
    frames.push_back({time_us, std::move(depth), std::string(reader.Take(colour_bytes))});
  }
  if (!reader.ok() || frames.empty() || OneIn(8)) return change_bytes_(bytes);
  const std::size_t which = Below(frames.size());
  switch (Below(5)) {
    case 0: {
      constexpr uLongf kMostBytes = 1 << 16;
      std::string plain(kMostBytes, '\0');
      uLongf size = kMostBytes;
      const std::string& packed = frames[which].depth;
      if (uncompress(reinterpret_cast<Bytef*>(plain.data()), &size,
                     reinterpret_cast<const Bytef*>(packed.data()),
                     static_cast<uLong>(packed.size())) == Z_OK) {
        plain.resize(size);
        frames[which].depth = Deflate(change_bytes_(plain));
      }
      break;
    }
    case 1:
      frames[which].colour = change_bytes_(frames[which].colour);
      break;
    case 2:
      frames[which].time_us = static_cast<std::int64_t>(
          static_cast<std::uint64_t>(frames[which].time_us) + Below(100'000) - 50'000);
      break;
    case 3:
      frames.push_back(frames[which]);
      frames.back().time_us =
          static_cast<std::int64_t>(static_cast<std::uint64_t>(frames.back().time_us) + 33'333);
      count = static_cast<std::int32_t>(frames.size());
      break;
    default:
      count = static_cast<std::int32_t>(frames.size() + Below(3) - 1);
      break;
  }
  std::string packed;
  PutBytes(count, packed);
  for (const KlgFrame& frame : frames) {
    PutBytes(frame.time_us, packed);
    PutBytes(static_cast<std::uint32_t>(frame.depth.size()), packed);
    PutBytes(static_cast<std::uint32_t>(frame.colour.size()), packed);
    packed += frame.depth + frame.colour;
  }
  return packed;
}

// The header's numbers, with its checksum.
std::string Mutator::ChangePng(const std::string& bytes) {
  constexpr std::size_t kHeaderAt = 12;  // "IHDR", width, height, bits, kind, ...
  constexpr std::size_t kHeaderSize = 17;
  if (bytes.size() < kHeaderAt + kHeaderSize + 4 || OneIn(2)) return change_bytes_(bytes);
  std::string changed = bytes;
  const std::size_t field = Below(4);
  if (field < 2) {
    constexpr std::uint32_t kSides[] = {0, 1, 2, 3, 8, 12, 13, 512, 513, 0x7FFFFFFF, 0xFFFFFFFF};
    changed.replace(kHeaderAt + 4 + 4 * field, 4, BigEndian(kSides[Below(std::size(kSides))]));
  } else {
    constexpr std::string_view kBitsAndKinds[] = {{"\x08\x00", 2}, {"\x10\x00", 2},
                                                  {"\x08\x02", 2}, {"\x10\x02", 2},
                                                  {"\x08\x06", 2}, {"\x01\x03", 2}};
    changed.replace(kHeaderAt + 12, 2, kBitsAndKinds[Below(std::size(kBitsAndKinds))]);
  }
  return changed.replace(
      kHeaderAt + kHeaderSize, 4,
      BigEndian(Crc32(std::string_view(changed).substr(kHeaderAt, kHeaderSize))));
}

std::string Mutator::ChangeFile(std::string_view name, const std::string& bytes) {
  if (bytes.empty()) return change_bytes_(bytes);
  if (name.ends_with(".tsdf")) return ChangeMap(bytes);
  if (name.ends_with(".glb")) return ChangeGlb(bytes);
  if (name.ends_with(".klg")) return ChangeKlg(bytes);
  if (name.ends_with(".png")) return ChangePng(bytes);
  if (name.ends_with(".json")) return ChangeJson(bytes);
  if (EndsWithAny(name, {".toml", ".txt", ".obj", ".mtl"})) return ChangeText(bytes);
  const bool may_be_text = EndsWithAny(name, {".ply", ".stl"});
  return may_be_text && OneIn(2) ? ChangeText(bytes) : change_bytes_(bytes);
}

std::string Mutator::ChangeSet(std::string_view input) {
  std::vector<Entry> entries = UnpackSet(input);
  if (entries.empty()) return change_bytes_(std::string(input));
  const std::size_t which = Below(entries.size());
  Entry& entry = entries[which];
  switch (Below(20)) {
    case 0:
      entries.erase(entries.begin() + static_cast<long>(which));
      break;
    case 1: {
      Entry copy = entry;
      copy.path = ChangePath(copy.path);
      entries.push_back(std::move(copy));
      break;
    }
    case 2:
      entry.path = ChangePath(entry.path);
      break;
    case 3:
      entry.bytes = entries[Below(entries.size())].bytes;
      break;
    case 4: {
      const char* const kTargets[] = {"/dev/zero", "..", ".", "/dev/shm", "nowhere", "../set"};
      entry.kind = static_cast<EntryKind>(Below(4));
      if (entry.kind == EntryKind::kLink) {
        entry.bytes =
            OneIn(2) ? entries[Below(entries.size())].path : kTargets[Below(std::size(kTargets))];
      }
      break;
    }
    default:
      entry.bytes = ChangeFile(entry.path, entry.bytes);
  }
  return PackSet(entries);
}

std::string Mutator::CrossSets(std::string_view first, std::string_view second) {
  std::vector<Entry> entries = UnpackSet(first);
  for (const Entry& other : UnpackSet(second)) {
    if (!OneIn(3)) continue;
    const auto same = std::find_if(entries.begin(), entries.end(),
                                   [&](const Entry& entry) { return entry.path == other.path; });
    if (same != entries.end()) {
      *same = other;
    } else {
      entries.push_back(other);
    }
  }
  return PackSet(entries);
}

}  // namespace tsdfpp::fuzz
