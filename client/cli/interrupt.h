// Ctrl-C, SIGTERM and SIGHUP: the first asks every wait to end (within 50 ms), the second ends the process on the spot.
#pragma once

namespace radiosity::cli {

/// Call once, first thing in main. Also ignores SIGPIPE and SIGXFSZ: a closed pipe, and a file that
/// reached `ulimit -f`, are error codes to us.
void catchSignals();
[[nodiscard]] bool interrupted();

}  // namespace radiosity::cli
