// Logging for both programs: spdlog to stderr, so that stdout stays for results.
#pragma once

#include <spdlog/spdlog.h>

#include <string_view>

namespace radiosity {

/// Call once at start-up. `level`: "debug", "info", "warn", "error", "off".
void startLog(std::string_view program, std::string_view level);

namespace log = spdlog;

}  // namespace radiosity
