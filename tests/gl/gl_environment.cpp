// Every GL test runs with a debug context, in which a driver's error message ends the program. Workers inherit it.
#include <cstdlib>

namespace {
[[maybe_unused]] const int kDebug = setenv("RADIOSITY_GL_DEBUG", "1", 1);
}
