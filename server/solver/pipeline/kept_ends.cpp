#include "server/solver/pipeline/kept_ends.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace radiosity::solver {
namespace {

constexpr std::size_t kMostEnds = 32;

}  // namespace

std::size_t KeptEnd::bytes() const {
  std::size_t bytes = sizeof(*this) + corrections.size() * sizeof(corrections[0]) + common.size() * sizeof(float);
  for (const auto* values : {&half[0], &half[1], &shaded[0], &shaded[1]}) bytes += values->size() * sizeof(glm::vec3);
  return bytes;
}

std::shared_ptr<const KeptEnd> KeptEnds::find(std::uint64_t key) {
  const auto found = std::ranges::find_if(ends_, [&](const auto& end) { return end->key == key; });
  if (found == ends_.end()) return nullptr;
  ends_.splice(ends_.begin(), ends_, found);
  return ends_.front();
}

void KeptEnds::keep(std::shared_ptr<const KeptEnd> end) {
  const auto same = std::ranges::find_if(ends_, [&](const auto& other) { return other->key == end->key; });
  if (same != ends_.end()) drop(same);
  const auto bytes = end->bytes();
  if (bytes > most_bytes_) return;
  while (!ends_.empty() && (ends_.size() >= kMostEnds || bytes_ + bytes > most_bytes_)) drop(std::prev(ends_.end()));
  bytes_ += bytes;
  ends_.push_front(std::move(end));
}

void KeptEnds::drop(std::list<std::shared_ptr<const KeptEnd>>::iterator end) {
  bytes_ -= (*end)->bytes();
  ends_.erase(end);
}

}  // namespace radiosity::solver
