#pragma once
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <map>
#include <string>
#include <vector>
namespace ticktmp {
inline double wall() {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now().time_since_epoch()).count();
}
inline double cpu() {
  timespec t;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return t.tv_sec * 1e3 + t.tv_nsec * 1e-6;
}
inline double last = wall(), lastc = cpu();
inline void tick(const char* name) {
  static FILE* ctl = std::getenv("PERFCTL") ? std::fopen(std::getenv("PERFCTL"), "w") : nullptr;
  if (ctl) {
    const std::string n = name;
    if (n == "-idle") {
      std::fputs("enable\n", ctl);
      std::fflush(ctl);
    }
    if (n == "assessStep") {
      std::fputs("disable\n", ctl);
      std::fflush(ctl);
    }
  }
  static const bool on = std::getenv("TICKS") != nullptr;
  if (!on) return;
  const double w = wall(), c = cpu();
  std::fprintf(stderr, "TICK %s %.2f %.2f\n", name, w - last, c - lastc);
  last = wall();
  lastc = cpu();
}
}  // namespace ticktmp
#define TICK(x) ticktmp::tick(x)
