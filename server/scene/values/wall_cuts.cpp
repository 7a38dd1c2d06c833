#include "server/scene/values/wall_cuts.h"

#include <algorithm>

namespace radiosity::scene {

bool WallCuts::operator==(const WallCuts& other) const {
  return std::ranges::equal(cut_, other.cut_, [](const auto& one, const auto& of_other) {
    return one.first == of_other.first && (one.second == of_other.second || *one.second == *of_other.second);
  });
}

}  // namespace radiosity::scene
