#include "core/exr_header.h"

#include <array>
#include <cstdint>
#include <cstring>
#include <optional>

namespace tsdfpp {
namespace {

// Takes pieces off the front of the bytes; nothing where they run out.
class Cursor {
 public:
  explicit Cursor(std::string_view bytes) : rest_(bytes) {}

  std::optional<std::string_view> Take(std::size_t size) {
    if (size > rest_.size()) return std::nullopt;
    const std::string_view taken = rest_.substr(0, size);
    rest_.remove_prefix(size);
    return taken;
  }

  std::optional<std::string_view> TakeText() {
    const auto text = Take(rest_.find('\0'));
    if (text) rest_.remove_prefix(1);
    return text;
  }

  std::optional<std::uint32_t> TakeInt() {
    const auto bytes = Take(sizeof(std::uint32_t));
    if (!bytes) return std::nullopt;
    std::uint32_t value = 0;
    std::memcpy(&value, bytes->data(), sizeof(value));
    return value;
  }

 private:
  std::string_view rest_;
};

std::vector<ExrChannel> ChannelsOf(std::string_view list) {
  // Linearity and three reserved bytes.
  constexpr std::size_t kUnused = 4;
  std::vector<ExrChannel> channels;
  Cursor cursor(list);
  while (true) {
    const auto name = cursor.TakeText();
    if (!name || name->empty()) return channels;
    const auto type = cursor.TakeInt();
    if (!type || *type > 2 || !cursor.Take(kUnused)) return {};
    const auto x_sampling = cursor.TakeInt();
    const auto y_sampling = cursor.TakeInt();
    if (!x_sampling || !y_sampling) return {};
    channels.push_back(
        {std::string(*name), static_cast<ExrType>(*type), *x_sampling == 1 && *y_sampling == 1});
  }
}

}  // namespace

std::optional<ExrHeader> ReadExrHeader(std::string_view bytes) {
  constexpr std::uint32_t kMagic = 20000630;
  Cursor cursor(bytes);
  if (cursor.TakeInt() != kMagic || !cursor.TakeInt()) return std::nullopt;
  ExrHeader header;
  while (true) {
    const auto name = cursor.TakeText();
    if (!name) return std::nullopt;
    if (name->empty()) break;  // the header's end
    if (!cursor.TakeText()) return std::nullopt;
    const auto size = cursor.TakeInt();
    const auto value = size ? cursor.Take(*size) : std::nullopt;
    if (!value) return std::nullopt;
    if (*name == "channels") {
      if (!header.channels.empty()) return std::nullopt;
      header.channels = ChannelsOf(*value);
    } else if (*name == "dataWindow") {
      std::array<std::int32_t, 4> box{};  // the least x and y, the greatest x and y
      if (header.width != 0 || value->size() != sizeof(box)) return std::nullopt;
      std::memcpy(box.data(), value->data(), sizeof(box));
      header.width = std::int64_t{box[2]} - box[0] + 1;
      header.height = std::int64_t{box[3]} - box[1] + 1;
    }
  }
  if (header.channels.empty() || header.width < 1 || header.height < 1) return std::nullopt;
  return header;
}

}  // namespace tsdfpp
