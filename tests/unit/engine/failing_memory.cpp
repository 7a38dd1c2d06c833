#include "tests/unit/engine/failing_memory.h"

#include <cstdlib>
#include <new>

namespace radiosity::test {
namespace {

struct Plan {
  bool armed = false;
  std::size_t number = 0, least_bytes = 0;
  Shortage shortage = Shortage::kOnce;
  std::size_t count = 0;
};
thread_local Plan plan;

void* allocate(std::size_t bytes) noexcept {
  if (plan.armed && bytes >= plan.least_bytes) {
    ++plan.count;
    const bool lasts = plan.shortage == Shortage::kFromThenOn;
    if (plan.number > 0 && (plan.count == plan.number || (lasts && plan.count > plan.number))) return nullptr;
  }
  return std::malloc(bytes > 0 ? bytes : 1);
}

}  // namespace

void failAllocation(std::size_t number, std::size_t least_bytes, Shortage shortage) {
  plan = {true, number, least_bytes, shortage, 0};
}

std::size_t letAllocate() {
  plan.armed = false;
  return plan.count;
}

}  // namespace radiosity::test

// All forms that a sanitizer would take apart: what comes from malloc() must go to free().
void* operator new(std::size_t bytes) {
  if (auto* memory = radiosity::test::allocate(bytes)) return memory;
  throw std::bad_alloc();
}
void* operator new[](std::size_t bytes) { return operator new(bytes); }
void* operator new(std::size_t bytes, const std::nothrow_t&) noexcept { return radiosity::test::allocate(bytes); }
void* operator new[](std::size_t bytes, const std::nothrow_t&) noexcept { return radiosity::test::allocate(bytes); }
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete[](void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, const std::nothrow_t&) noexcept { std::free(memory); }
void operator delete[](void* memory, const std::nothrow_t&) noexcept { std::free(memory); }
