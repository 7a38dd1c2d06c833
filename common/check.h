// CHECK is for our own bugs: it prints both values and aborts. Anything a user can cause is a Result (result.h).
#pragma once

#include <cstdio>
#include <cstdlib>
#include <sstream>
#include <string>

namespace radiosity::detail {

[[noreturn]] inline void checkFailed(const char* file, int line, const std::string& what) {
  std::fprintf(stderr, "%s:%d: CHECK failed: %s\n", file, line, what.c_str());
  std::abort();
}

template <typename A, typename B>
std::string describe(const char* expression, const A& a, const B& b) {
  std::ostringstream out;
  out << expression << " (" << a << " vs " << b << ")";
  return out.str();
}

}  // namespace radiosity::detail

// NOLINTBEGIN(cppcoreguidelines-macro-usage): only a macro sees the expression's text and place
#define RAD_CHECK(condition)                                                            \
  do {                                                                                  \
    if (!(condition)) ::radiosity::detail::checkFailed(__FILE__, __LINE__, #condition); \
  } while (false)
#define RAD_CHECK_OP(a, op, b)                                                                          \
  do {                                                                                                  \
    const auto& rad_a = (a);                                                                            \
    const auto& rad_b = (b);                                                                            \
    if (!(rad_a op rad_b))                                                                              \
      ::radiosity::detail::checkFailed(__FILE__, __LINE__,                                              \
                                       ::radiosity::detail::describe(#a " " #op " " #b, rad_a, rad_b)); \
  } while (false)
#define RAD_CHECK_EQ(a, b) RAD_CHECK_OP(a, ==, b)
#define RAD_CHECK_LT(a, b) RAD_CHECK_OP(a, <, b)
#define RAD_CHECK_LE(a, b) RAD_CHECK_OP(a, <=, b)
// NOLINTEND(cppcoreguidelines-macro-usage)
