// What `radiosity` returns to the shell, and how an error becomes one line on stderr and such a code.
#pragma once

#include "client/lib/connection.h"
#include "common/result.h"

namespace radiosity::cli {

enum class ExitCode : int {
  kOk = 0,            ///< done; for solve and watch: the asked error was reached
  kFailed = 1,        ///< no server, no driver, full disk
  kBadInput = 2,      ///< an option, file, scene or patch is wrong
  kShort = 3,         ///< ended above the asked error (time limit, memory for links); output was written
  kInterrupted = 75,  ///< Ctrl-C or SIGTERM (EX_TEMPFAIL: running it again makes sense)
};

[[nodiscard]] ExitCode exitCodeOf(ErrorCode code);

/// One line on stderr, "radiosity: error: ..."; returns the code. After an interruption the error is only its echo: the
/// line says "interrupted" and the code is kInterrupted.
ExitCode complain(const Error& error);
/// With the index of the failing operation where the server named it.
ExitCode complain(const client::CallFailure& failure);

/// "radiosity: warning: ..."
void warn(const std::string& text);

}  // namespace radiosity::cli
