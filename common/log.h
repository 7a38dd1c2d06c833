// Logging for both programs: spdlog to stderr, so that stdout stays for results.
#pragma once

#include <spdlog/spdlog.h>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace radiosity {

/// Lines are valid UTF-8, whatever their text holds. kText: "2026-01-01T00:00:00.000 warning [radiosityd] text", local
/// time; what cannot be printed is escaped (common/printable.h). kJson: one object a line, {"time" (RFC 3339,
/// UTC), "level", "program", "message"} and where they apply "revision" and "requestId"; always valid UTF-8.
enum class LogFormat { kText, kJson };

/// Call once at start-up. `level`: "debug", "info", "warn", "error", "off".
void startLog(std::string_view program, std::string_view level, LogFormat format = LogFormat::kText);

/// What a line of the log is about, beside its text; shown by LogFormat::kJson.
struct LogFields {
  std::optional<std::uint64_t> revision = {};
  std::string request_id = {};  ///< empty: none
};

/// Lines that this thread logs while it lives carry the fields; those of an inner scope go before.
class LogScope {
 public:
  explicit LogScope(LogFields fields);
  ~LogScope();
  LogScope(const LogScope&) = delete;
  LogScope& operator=(const LogScope&) = delete;

 private:
  LogFields fields_;
  const LogFields* outer_;
};

namespace log = spdlog;

}  // namespace radiosity
