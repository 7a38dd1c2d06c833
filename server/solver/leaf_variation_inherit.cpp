// LeafVariation after an edit of geometry. Nine of ten ways from a receiver meet no leaf near by; to find that out was
// most of what paths took, and an edit changes it only where something was or is that moved.
#include <algorithm>

#include "server/solver/leaf_variation.h"

namespace radiosity::solver {

void LeafVariation::inherit(const LeafVariation& former, std::span<const std::uint32_t> value_before,
                            const std::vector<bool>& clear) {
  if (!former.is_traced_ || stands_for_ != 1.0 || former.stands_for_ != 1.0) return;
  if (former.count_.empty() || !former.wanted_.empty()) return;  // what is still to be traced is not known
  const auto fewest = *std::ranges::min_element(former.count_);
  std::vector<std::uint16_t> count_before;  // by former leaf value
  for (std::size_t r = 0; r < former.receivers_.size(); ++r) {
    count_before.resize(former.receivers_[r] + 1, 0);
    count_before.back() = former.count_[r];
  }
  std::vector<std::uint32_t> value_after(count_before.size(), scene::kNone);
  known_.assign(value_before.size(), 0);
  count_.assign(receivers_.size(), fewest);
  for (std::size_t r = 0; r < receivers_.size(); ++r) {
    const auto value = receivers_[r], before = value_before[value];
    if (before >= count_before.size() || count_before[before] == 0) continue;
    count_[r] = count_before[before];
    if (!clear[value]) continue;
    known_[value] = count_before[before];
    value_after[before] = value;
  }
  for (std::size_t half = 0; half < 2; ++half) {
    for (const auto& path : former.paths_[half]) {
      const auto receiver = value_after[path.receiver];
      if (receiver != scene::kNone) there_[half].push_back(numberOf(receiver, path.index));
    }
    std::ranges::sort(there_[half]);
  }
}

/// No leaf is near that way.
bool LeafVariation::isKnownToEnd(std::uint32_t receiver, std::uint32_t index, std::size_t half) const {
  if (known_.empty() || index >= known_[receiver]) return false;
  return !std::ranges::binary_search(there_[half], numberOf(receiver, index));
}

}  // namespace radiosity::solver
