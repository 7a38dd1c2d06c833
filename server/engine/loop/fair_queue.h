// Things that wait for their turn: sessions come in turn, and each has its things done in the order in which it asked.
// A value; the caller's lock guards it.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <iterator>
#include <optional>
#include <utility>
#include <vector>

namespace radiosity::engine {

template <typename Item>
class FairQueue {
 public:
  void push(std::uint64_t session, Item item) {
    auto place = std::ranges::find(turns_, session, &Turn::session);
    if (place == turns_.end()) place = turns_.insert(turns_.end(), Turn{session, {}});
    place->items.push_back(std::move(item));
    ++size_;
  }

  /// The oldest item of the session whose turn it is; nothing where none waits. O(1).
  [[nodiscard]] std::optional<Item> pop() {
    if (turns_.empty()) return std::nullopt;
    auto turn = std::move(turns_.front());
    turns_.pop_front();
    std::optional<Item> item(std::move(turn.items.front()));
    turn.items.pop_front();
    --size_;
    if (!turn.items.empty()) turns_.push_back(std::move(turn));
    return item;
  }

  /// Takes out all items for which `matches(item)`. O(items).
  template <typename Matches>
  [[nodiscard]] std::vector<Item> takeIf(const Matches& matches) {
    std::vector<Item> taken;
    for (auto& turn : turns_) {
      const auto kept =
          std::stable_partition(turn.items.begin(), turn.items.end(), [&](const Item& item) { return !matches(item); });
      std::move(kept, turn.items.end(), std::back_inserter(taken));
      turn.items.erase(kept, turn.items.end());
    }
    std::erase_if(turns_, [](const Turn& turn) { return turn.items.empty(); });
    size_ -= taken.size();
    return taken;
  }

  [[nodiscard]] std::size_t size() const { return size_; }

 private:
  struct Turn {
    std::uint64_t session;
    std::deque<Item> items;  ///< never empty
  };

  std::deque<Turn> turns_;
  std::size_t size_ = 0;
};

}  // namespace radiosity::engine
