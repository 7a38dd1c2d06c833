// Which of many things hang together (Tarjan 1975, "Efficiency of a good but not linear set union algorithm"; paths are
// halved). Plain values.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

namespace radiosity {

class UnionFind {
 public:
  /// Each is alone at first.
  explicit UnionFind(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0U); }

  /// The first of those that hang together with it. Changes nothing that can be seen.
  [[nodiscard]] std::uint32_t find(std::uint32_t item) {
    while (parent_[item] != item) item = parent_[item] = parent_[parent_[item]];
    return item;
  }
  void join(std::uint32_t one, std::uint32_t other) {
    const auto a = find(one), b = find(other);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::uint32_t> parent_;
};

}  // namespace radiosity
