#include "common/log.h"

#include <fmt/chrono.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_sinks.h>

#include <algorithm>
#include <chrono>
#include <iterator>
#include <memory>
#include <string>
#include <utility>

#include "common/printable.h"

namespace radiosity {
namespace {

thread_local const LogFields* current_fields = nullptr;

/// As a JSON string. A file's name may be any bytes; those that are not UTF-8 become U+FFFD.
void appendString(spdlog::memory_buf_t& out, std::string_view text) {
  auto to = std::back_inserter(out);
  out.push_back('"');
  while (!text.empty()) {
    const auto length = characterLength(text);
    const auto c = static_cast<unsigned char>(text.front());
    if (length == 0) {
      fmt::format_to(to, "\\ufffd");
    } else if (c == '"' || c == '\\') {
      fmt::format_to(to, "\\{}", text.front());
    } else if (c < 0x20 || c == 0x7f) {
      fmt::format_to(to, "\\u{:04x}", c);
    } else {
      out.append(text.data(), text.data() + length);
    }
    text.remove_prefix(std::max<std::size_t>(1, length));
  }
  out.push_back('"');
}

/// Valid UTF-8, and nothing that a peer named can begin a line of its own.
class TextFormatter final : public spdlog::formatter {
 public:
  void format(const spdlog::details::log_msg& line, spdlog::memory_buf_t& out) override {
    spdlog::memory_buf_t text;
    pattern_.format(line, text);
    std::string_view rest(text.data(), text.size());
    if (rest.ends_with('\n')) rest.remove_suffix(1);
    const auto shown = printable(rest);
    out.append(shown.data(), shown.data() + shown.size());
    out.push_back('\n');
  }
  [[nodiscard]] std::unique_ptr<spdlog::formatter> clone() const override { return std::make_unique<TextFormatter>(); }

 private:
  spdlog::pattern_formatter pattern_{"%Y-%m-%dT%H:%M:%S.%e %l [%n] %v"};
};

class JsonFormatter final : public spdlog::formatter {
 public:
  void format(const spdlog::details::log_msg& line, spdlog::memory_buf_t& out) override {
    const auto time = std::chrono::time_point_cast<std::chrono::milliseconds>(line.time);
    const auto whole = std::chrono::floor<std::chrono::seconds>(time);
    const auto level = spdlog::level::to_string_view(line.level);
    auto to = std::back_inserter(out);
    fmt::format_to(to, R"({{"time":"{:%Y-%m-%dT%H:%M:%S}.{:03}Z","level":"{}","program":)",
                   fmt::gmtime(std::chrono::system_clock::to_time_t(whole)), (time - whole).count(),
                   std::string_view(level.data(), level.size()));
    appendString(out, {line.logger_name.data(), line.logger_name.size()});
    fmt::format_to(to, R"(,"message":)");
    appendString(out, {line.payload.data(), line.payload.size()});
    if (current_fields != nullptr && current_fields->revision)
      fmt::format_to(to, R"(,"revision":{})", *current_fields->revision);
    if (current_fields != nullptr && !current_fields->request_id.empty()) {
      fmt::format_to(to, R"(,"requestId":)");
      appendString(out, current_fields->request_id);
    }
    fmt::format_to(to, "}}\n");
  }
  [[nodiscard]] std::unique_ptr<spdlog::formatter> clone() const override { return std::make_unique<JsonFormatter>(); }
};

}  // namespace

void startLog(std::string_view program, std::string_view level, LogFormat format) {
  auto logger =
      std::make_shared<spdlog::logger>(std::string(program), std::make_shared<spdlog::sinks::stderr_sink_mt>());
  if (format == LogFormat::kJson) {
    logger->set_formatter(std::make_unique<JsonFormatter>());
  } else {
    logger->set_formatter(std::make_unique<TextFormatter>());
  }
  logger->set_level(spdlog::level::from_str(std::string(level)));
  spdlog::set_default_logger(std::move(logger));
}

LogScope::LogScope(LogFields fields) : fields_(std::move(fields)), outer_(current_fields) {
  if (outer_ != nullptr) {
    if (!fields_.revision) fields_.revision = outer_->revision;
    if (fields_.request_id.empty()) fields_.request_id = outer_->request_id;
  }
  current_fields = &fields_;
}

LogScope::~LogScope() { current_fields = outer_; }

}  // namespace radiosity
