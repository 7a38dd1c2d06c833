// Loaded into radiosityd before all else (LD_PRELOAD) by the tests of renderers: lets its graphics contexts fail as a
// driver would, when the test says so. RADIOSITY_TEST_GL_FAULTS names a folder; who checks its context
//   and finds WHO-reset.N (N: 0 to 9) there takes the file away, and is told once that this context is lost;
//   and finds WHO-memory.N there takes it away, and is told once that the driver is out of memory;
//   while WHO-reset is there, is told each time that its context is lost.
// WHO is `worker` or `server`.
#include <epoxy/gl.h>
#include <unistd.h>

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>

namespace {

using Query = GLenum (*)();

Query real_reset_status = nullptr, real_error = nullptr;

std::string path(const char* fault) {
  static const std::string kPrefix = [] {
    std::ifstream file("/proc/self/cmdline");
    const std::string arguments((std::istreambuf_iterator<char>(file)), {});
    const char* folder = std::getenv("RADIOSITY_TEST_GL_FAULTS");
    const bool worker =
        arguments.find("--worker") != std::string::npos && arguments.find("--listen") == std::string::npos;
    return (folder != nullptr ? std::string(folder) : "/nonexistent") + (worker ? "/worker-" : "/server-");
  }();
  return kPrefix + fault;
}

bool taken(const char* fault) {
  const auto file = path(fault);
  for (int n = 0; n < 10; ++n)
    if (unlink((file + "." + std::to_string(n)).c_str()) == 0) return true;
  return false;
}

/// libepoxy looks a function up when it is called first, where its own is shown then, and shows what it has found.
GLenum ask(Query& real, Query& shown, Query hook) {
  shown = real;
  const auto answer = real();
  real = shown;
  shown = hook;
  return answer;
}

GLenum resetStatus() {
  const auto answer = ask(real_reset_status, epoxy_glGetGraphicsResetStatus, resetStatus);
  return taken("reset") || access(path("reset").c_str(), F_OK) == 0 ? GL_GUILTY_CONTEXT_RESET : answer;
}

GLenum error() {
  const auto answer = ask(real_error, epoxy_glGetError, error);
  static bool told = false;  // who was told asks again until there is no error left
  told = !told && taken("memory");
  return told ? GL_OUT_OF_MEMORY : answer;
}

[[gnu::constructor]] void install() {
  real_reset_status = epoxy_glGetGraphicsResetStatus;
  real_error = epoxy_glGetError;
  epoxy_glGetGraphicsResetStatus = resetStatus;
  epoxy_glGetError = error;
}

}  // namespace
