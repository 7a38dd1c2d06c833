// The --report file and what `status` prints. Pure.
#pragma once

#include <string>

#include "client/cli/progress_line.h"
#include "protocol/messages.h"

namespace radiosity::cli {

/// JSON of a finished solve: {seconds, shots, patches, surfaces, polygons, error, energy, revision, gl_renderer,
/// warnings, counters, ...}. Seconds of solving, errors as fractions, energy in lumens.
[[nodiscard]] std::string reportJson(const protocol::StatusReply& status, bool reached);

/// The status as the protocol's JSON, indented.
[[nodiscard]] std::string statusJson(const protocol::StatusReply& status);
/// The status for people, several lines.
[[nodiscard]] std::string statusText(const protocol::StatusReply& status);

[[nodiscard]] ProgressView viewOf(const protocol::Progress& progress, double target_error);

/// "no light arrives: all of it leaves the scene": what is said in the place of an error where Progress::unlit tells
/// why.
[[nodiscard]] std::string unlitText(const protocol::Progress& progress);

/// "error 1.98 % after 3.2 s, 12,345 shots, 14,002 patches, revision 1"
[[nodiscard]] std::string outcomeText(const protocol::Progress& progress);

/// "; 95 % of places within 20 %", once that is measured, and "; texels alone are 1.4 % off" where they are too wide
/// for the error to be much less, however well light is known on them.
[[nodiscard]] std::string surfaceText(const protocol::ErrorParts& error);

}  // namespace radiosity::cli
