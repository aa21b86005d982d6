#include "core/files.h"

#include <unistd.h>

#include <array>
#include <fstream>

namespace tsdfpp {
namespace fs = std::filesystem;

Expected<std::string> ReadFile(const fs::path& path) {
  std::error_code code;
  if (!fs::exists(path, code)) return DataError("{}: no such file", path.string());
  if (fs::is_directory(path, code)) return DataError("{}: is a folder, not a file", path.string());
  std::ifstream in(path, std::ios::binary);
  std::string bytes;
  std::array<char, 65536> block{};
  while (in.read(block.data(), block.size()) || in.gcount() > 0) {
    bytes.append(block.data(), static_cast<std::size_t>(in.gcount()));
  }
  if (!in.eof()) return DataError("{}: cannot be read", path.string());
  return bytes;
}

Expected<void> WriteFile(const fs::path& path, std::string_view bytes) {
  if (path.has_parent_path()) {
    std::error_code code;
    fs::create_directories(path.parent_path(), code);
    if (code) {
      return EnvironmentError("{}: the folder cannot be made ({})", path.parent_path().string(),
                              code.message());
    }
  }
  const fs::path temporary = fmt::format("{}.{}.part", path.string(), getpid());
  {
    std::ofstream out(temporary, std::ios::binary);
    out.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    out.close();
    if (!out) {
      std::error_code ignored;
      fs::remove(temporary, ignored);
      return EnvironmentError("{}: cannot be written", path.string());
    }
  }
  std::error_code code;
  fs::rename(temporary, path, code);
  if (code) {
    std::error_code ignored;
    fs::remove(temporary, ignored);
    return EnvironmentError("{}: cannot be written ({})", path.string(), code.message());
  }
  return {};
}

Expected<void> MakeWritableFolder(const fs::path& path) {
  std::error_code code;
  fs::create_directories(path, code);
  if (code)
    return EnvironmentError("{}: the folder cannot be made ({})", path.string(), code.message());
  const fs::path probe = path / fmt::format(".tsdfpp-probe-{}", getpid());
  if (!WriteFile(probe, "").has_value()) {
    return EnvironmentError("{}: the folder cannot be written to", path.string());
  }
  fs::remove(probe, code);
  return {};
}

}  // namespace tsdfpp
