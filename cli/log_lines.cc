#include "cli/log_lines.h"

#include <fcntl.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/ansicolor_sink.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cstdio>
#include <memory>
#include <string_view>

#include "core/one_line.h"

namespace tsdfpp {
namespace {

// The message (%v) as one line.
class OneLineFlag : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg& message, const std::tm&,
              spdlog::memory_buf_t& out) override {
    const std::string line =
        OneLine(std::string_view(message.payload.data(), message.payload.size()));
    out.append(line.data(), line.data() + line.size());
  }
  std::unique_ptr<custom_flag_formatter> clone() const override {
    return std::make_unique<OneLineFlag>();
  }
};

}  // namespace

void LogOneLineEach() {
  // A descriptor of its own, as a QuietStderr takes the other away.
  const int own = fcntl(STDERR_FILENO, F_DUPFD_CLOEXEC, 0);
  std::FILE* const file = own < 0 ? stderr : fdopen(own, "w");
  using Sink = spdlog::sinks::ansicolor_sink<spdlog::details::console_mutex>;
  spdlog::set_default_logger(std::make_shared<spdlog::logger>(
      "tsdfpp",
      std::make_shared<Sink>(file == nullptr ? stderr : file, spdlog::color_mode::automatic)));
  auto formatter = std::make_unique<spdlog::pattern_formatter>();
  formatter->add_flag<OneLineFlag>('*').set_pattern("%^%l%$: %*");
  spdlog::set_formatter(std::move(formatter));
}

}  // namespace tsdfpp
