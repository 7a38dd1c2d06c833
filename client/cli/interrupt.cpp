#include "client/cli/interrupt.h"

#include <unistd.h>

#include <csignal>

#include "client/cli/exit_code.h"

namespace radiosity::cli {
namespace {

volatile std::sig_atomic_t g_interrupted = 0;

void onSignal(int /*number*/) {
  if (g_interrupted != 0) _exit(static_cast<int>(ExitCode::kInterrupted));
  g_interrupted = 1;
}

}  // namespace

void catchSignals() {
  struct sigaction action {};
  action.sa_handler = onSignal;
  sigemptyset(&action.sa_mask);
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) sigaction(number, &action, nullptr);
  action.sa_handler = SIG_IGN;
  for (const int number : {SIGPIPE, SIGXFSZ}) sigaction(number, &action, nullptr);
}

bool interrupted() { return g_interrupted != 0; }

}  // namespace radiosity::cli
