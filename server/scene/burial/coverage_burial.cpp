// The part of a surface that lies inside another solid (the floor under a block, a wall behind a cupboard) receives no
// light and must not count as area. A solid is what single-sided surfaces bound: from inside, one meets backs first.
#include <algorithm>
#include <iterator>
#include <optional>
#include <utility>

#include "common/give_back.h"
#include "common/parallel.h"
#include "server/scene/burial/burial_budget.h"
#include "server/scene/burial/coverage.h"
#include "server/scene/burial/leaf_burial.h"
#include "server/scene/burial/solids.h"

namespace radiosity::scene {
namespace {

/// Leaves: what is found of so many is held at once; so many are measured in a turn; fewer are not tried in a thread.
constexpr std::size_t kMeasuredAtOnce = 65536, kLeavesATurn = 16, kFewestTries = 16;
/// Part of the time a scene takes to build that has passed before the leaves are measured, and after.
constexpr double kMeasureBegins = 0.35, kMeasureEnds = 0.7;
/// Surfaces, likewise.
constexpr std::size_t kFewestSurfaces = 32;
/// Hits::work, 2 or 3 s of one core, of leaves that nothing comes near: each surface has its share.
constexpr std::uint64_t kUniformWork = 400'000'000;
/// Of more leaves it is not kept how they were found, nor where that takes more, and from more places than these rays
/// were cast for hardly any.
constexpr std::size_t kMostRecorded = 80'000, kMostRecordedBytes = std::size_t{16} << 20, kMostFans = 64;

/// Boxes around the nodes of one surface, for the question where other solids come near.
class NodeBoxes {
 public:
  NodeBoxes(const PatchScene& patches, std::uint32_t id, const std::vector<LeafPiece>& pieces, const LeafBurial& leaves)
      : patches_(patches), surface_(patches.surfaces[id]) {
    if (!surface_.planar) fillCurved(pieces, leaves);
  }

  [[nodiscard]] Bounds box(std::uint32_t level, std::uint32_t x, std::uint32_t y) const {
    if (!surface_.planar) {
      const LevelGrid grid = levelGrid(surface_.width, surface_.height, level);
      return boxes_[grid.offset + y * grid.width + x];
    }
    const TriangleFrame& frame = patches_.triangles[surface_.first_triangle];
    return cornersBox(frame, {x << level, y << level},
                      {std::min((x + 1) << level, surface_.width), std::min((y + 1) << level, surface_.height)});
  }

 private:
  static Bounds cornersBox(const TriangleFrame& frame, const glm::uvec2& low, const glm::uvec2& high) {
    Bounds box;
    for (const std::uint32_t x : {low.x, high.x})
      for (const std::uint32_t y : {low.y, high.y}) box.add(positionAt(frame, {x, y}));
    return box;
  }

  void fillCurved(const std::vector<LeafPiece>& pieces, const LeafBurial& leaves) {
    const LevelGrid top = levelGrid(surface_.width, surface_.height, surface_.level_count - 1);
    boxes_.resize(top.offset + 1);
    for (std::uint32_t i = 0; i < surface_.width * surface_.height; ++i) {
      const std::uint32_t leaf = surface_.first_leaf + i;
      if (patches_.leaves[leaf].triangle == kNone) continue;
      const glm::uvec2 low(i % surface_.width, i / surface_.width);
      boxes_[i] = cornersBox(patches_.triangles[patches_.leaves[leaf].triangle], low, low + 1U);
      const auto of_leaf = leaves.piecesOf(leaf);
      for (auto p = of_leaf.first; p < of_leaf.end; ++p)
        boxes_[i].add(cornersBox(patches_.triangles[pieces[p].triangle], low, low + 1U));
    }
    LevelGrid below = levelGrid(surface_.width, surface_.height, 0);
    for (std::uint32_t level = 1; level < surface_.level_count; ++level) {
      const LevelGrid grid = levelGrid(surface_.width, surface_.height, level);
      for (std::uint32_t y = 0; y < below.height; ++y)
        for (std::uint32_t x = 0; x < below.width; ++x)
          boxes_[grid.offset + (y / 2) * grid.width + x / 2].add(boxes_[below.offset + y * below.width + x]);
      below = grid;
    }
  }

  const PatchScene& patches_;
  const Surface& surface_;
  std::vector<Bounds> boxes_;
};

class Burial {
 public:
  Burial(PatchScene& patches, const std::vector<LeafPiece>& pieces, const std::vector<Hides>& hides,
         const Solids& solids, const Coincidence& coincidence, const FormerBurial* former)
      : patches_(patches),
        pieces_(pieces),
        solids_(solids),
        coincidence_(coincidence),
        former_(former),
        looks_(affordableLooks(patches.leaves.size())),
        leaves_(patches, pieces, solids_, coincidence) {
    record_.hides = hides;
    record_.covered = coincidence.covered();
  }

  std::shared_ptr<const BurialRecord> run() {
    if (solids_.empty() && !coincidence_.found()) return nullptr;
    classifyAll();
    tryLeaves();
    measureAll(contacts_, places_.few, BurialRecord::Pass::kFew);
    refineBorders();
    if (auto warning = budgetWarning(places_, undecided_); !warning.empty())
      patches_.warnings.push_back(std::move(warning));
    settleSides();
    return keptRecord();
  }

 private:
  struct Measured {
    std::optional<BuriedPart> buried;                 ///< none: all of it is visible
    std::shared_ptr<const BurialRecord::Found> kept;  ///< null: it is not worth keeping
    bool is_undecided = false;                        ///< as BurialRecord::Found
  };

  /// Of one surface: leaves in contact, and what is buried beside them.
  struct Split {
    std::vector<Contact> contacts;
    std::vector<BuriedPart> buried;
    std::size_t undecided = 0;  ///< leaves
  };

  /// Surfaces side by side, taken in their order.
  void classifyAll() {
    std::vector<Split> splits(patches_.surfaces.size());
    inShares(splits.size() / kFewestSurfaces, [&](std::size_t share, std::size_t shares) {
      Hits hits;
      hits.most_of_place = affordableWork(splits.size());
      for (auto s = share; s < splits.size(); s += shares) classify(static_cast<std::uint32_t>(s), hits, splits[s]);
    });
    for (std::size_t s = 0; s < splits.size(); ++s) {
      auto& split = splits[s];
      const Surface& surface = patches_.surfaces[s];
      for (const auto& part : split.buried)
        patches_.node_area[surface.first_node[part.side] + (part.leaf - surface.first_leaf)] = 0.0F;
      contacts_.insert(contacts_.end(), split.contacts.begin(), split.contacts.end());
      changes_.insert(changes_.end(), std::make_move_iterator(split.buried.begin()),
                      std::make_move_iterator(split.buried.end()));
      undecided_ += split.undecided;
    }
  }

  /// Splits a surface into nodes that no other solid comes near (all visible or all buried: one test, if it is clear)
  /// and single leaves in contact with one, or with an earlier surface that covers some of them.
  void classify(std::uint32_t s, Hits& hits, Split& split) const {
    hits.work = 0;
    const NodeBoxes boxes(patches_, s, pieces_, leaves_);
    const Surface& surface = patches_.surfaces[s];
    for (std::uint32_t side = 0; side < 2; ++side)
      if (surface.first_node[side] != kNone) descend(boxes, {s, side, 0, 0}, surface.level_count - 1, hits, split);
  }

  /// `node`: its place in the grid of its level.
  void descend(const NodeBoxes& boxes, const Contact& node, std::uint32_t level, Hits& hits, Split& split) const {
    interruptionPoint();
    const Surface& surface = patches_.surfaces[node.surface];
    const Bounds box = boxes.box(level, node.x, node.y);
    if (box.empty()) return;
    if (!solids_.near(box, node.surface, looks_) && !coincidence_.mayCover(node.surface, node.side, box)) {
      settleUniform(node, level, hits, split);
      return;
    }
    if (level == 0) {
      if (patches_.leaves[leaves_.leafOf(node)].triangle != kNone) split.contacts.push_back(node);
      return;
    }
    const LevelGrid below = levelGrid(surface.width, surface.height, level - 1);
    for (std::uint32_t y = 2 * node.y; y < std::min(2 * node.y + 2, below.height); ++y)
      for (std::uint32_t x = 2 * node.x; x < std::min(2 * node.x + 2, below.width); ++x)
        descend(boxes, {node.surface, node.side, x, y}, level - 1, hits, split);
  }

  /// Nothing comes near: where one place is visible and no ray disagreed all are. What is buried is asked leaf by leaf,
  /// since it loses all its light: models are open at their ends, and a chart may pass through itself. Where that takes
  /// too long, thousands of solids one within the other, the others are as the last that was asked.
  void settleUniform(const Contact& node, std::uint32_t level, Hits& hits, Split& split) const {
    const Surface& surface = patches_.surfaces[node.surface];
    const std::uint32_t x_end = std::min((node.x + 1) << level, surface.width);
    const std::uint32_t y_end = std::min((node.y + 1) << level, surface.height);
    const auto most = kUniformWork / patches_.surfaces.size();
    bool is_first = true, is_buried = false;
    for (std::uint32_t y = node.y << level; y < y_end; ++y)
      for (std::uint32_t x = node.x << level; x < x_end; ++x) {
        interruptionPoint();
        const Contact leaf{node.surface, node.side, x, y};
        const LeafPoint& point = patches_.leaves[leaves_.leafOf(leaf)];
        if (point.triangle == kNone) continue;
        if (is_first || hits.work < most) {
          const auto answer = leaves_.ask(point.triangle, glm::dvec2(point.texel), node.side, hits);
          if (std::exchange(hits.gave_up, false)) ++split.undecided;
          if (std::exchange(is_first, false) && !answer.buried && answer.agreed) return;
          is_buried = answer.buried;
        }
        if (is_buried) split.buried.push_back({leaves_.leafOf(leaf), node.side, {}, {}, 0.0F});
      }
  }

  /// Sets how many places of the others are asked.
  void tryLeaves() {
    tried_.resize(triedLeaves(contacts_.size()));
    places_ = {TriedLeaf::kPlaces, TriedLeaf::kPlaces, TriedLeaf::kPlaces};
    inShares(tried_.size() / kFewestTries, [&](std::size_t share, std::size_t shares) {
      LeafBurial::Scratch scratch;
      for (auto i = share; i < tried_.size(); i += shares) {
        scratch.hits.work = 0;
        scratch.notes.clear();
        const auto& contact = contacts_[(2 * i + 1) * contacts_.size() / (2 * tried_.size())];
        const auto found = leaves_.measure(contact, TriedLeaf::kPlaces, places_, scratch);
        tried_[i] = {scratch.hits.work, found.has_value(), !found || found->visible_area > 0.0F};
      }
    });
    places_ = affordablePlaces(contacts_.size(), tried_);
  }

  /// Visible areas of leaves: measured side by side, taken in their order.
  void measureAll(const std::vector<Contact>& contacts, std::uint32_t count, BurialRecord::Pass pass) {
    std::vector<Measured> measured;
    for (std::size_t first = 0; first < contacts.size(); first += kMeasuredAtOnce) {
      const auto end = std::min(contacts.size(), first + kMeasuredAtOnce);
      if (pass == BurialRecord::Pass::kFew)
        tellMeasured(static_cast<double>(first) / static_cast<double>(contacts.size()));
      measured.assign(end - first, {});
      // Most are remembered after an edit, and those that are not lie together.
      inTurns((end - first + kLeavesATurn - 1) / kLeavesATurn, [&](std::size_t part) {
        LeafBurial::Scratch scratch;
        const auto from = first + part * kLeavesATurn;
        for (auto i = from; i < std::min(end, from + kLeavesATurn); ++i)
          measured[i - first] = remember(contacts[i], count, pass, scratch);
      });
      for (auto i = first; i < end; ++i) {
        auto& found = measured[i - first];
        const auto& contact = contacts[i];
        undecided_ += found.is_undecided ? 1 : 0;
        if (found.kept) record(contact, pass, std::move(found.kept));
        if (!found.buried) continue;
        patches_.node_area[leaves_.nodeOf(contact)] = found.buried->visible_area;
        changes_.push_back(std::move(*found.buried));
        touched_.push_back(contact);
      }
    }
  }

  /// `part`: of the few places of all leaves, in [0, 1].
  static void tellMeasured(double part) {
    if (auto* task = currentTask()) task->tellProgress(kMeasureBegins + (kMeasureEnds - kMeasureBegins) * part);
  }

  /// As measure(), or from what was found before an edit.
  [[nodiscard]] Measured remember(const Contact& contact, std::uint32_t count, BurialRecord::Pass pass,
                                  LeafBurial::Scratch& scratch) const {
    interruptionPoint();
    const bool by_rays = !record_.covered[contact.surface];
    if (by_rays && former_ != nullptr) {
      const auto leaf = leaves_.leafOf(contact) - patches_.surfaces[contact.surface].first_leaf;
      if (const auto* known = former_->find(contact.surface, leaf, contact.side, pass, places_)) {
        Measured same{{}, known->found, known->found->is_undecided};
        if (same.kept->buried) same.buried = former_->renumbered(*same.kept, contact.surface);
        return same;
      }
    }
    scratch.notes.clear();
    Measured found{leaves_.measure(contact, count, places_, scratch), {}, scratch.hits.gave_up};
    const auto& fans = scratch.notes.fans();
    if (!by_rays || fans.empty() || fans.size() > kMostFans) return found;
    const Surface& surface = patches_.surfaces[contact.surface];
    found.kept = std::make_shared<const BurialRecord::Found>(
        BurialRecord::Found{fans, found.buried, surface.first_leaf, surface.first_triangle, found.is_undecided});
    return found;
  }

  void record(const Contact& contact, BurialRecord::Pass pass, std::shared_ptr<const BurialRecord::Found> found) {
    if (is_too_much_) return;
    recorded_bytes_ += sizeof(BurialRecord::Leaf) + sizeof(BurialRecord::Found) + found->fans.size() * sizeof(RayFan) +
                       (found->buried ? found->buried->visible.bytes() : 0);
    is_too_much_ = recorded_bytes_ > kMostRecordedBytes || record_.leaves.size() >= kMostRecorded;
    if (is_too_much_) {
      giveBack(record_.leaves);
    } else {
      record_.leaves.push_back({leaves_.leafOf(contact), contact.side, pass, std::move(found)});
    }
  }

  std::shared_ptr<const BurialRecord> keptRecord() {
    if (is_too_much_) return nullptr;
    record_.places = places_;
    record_.sort();
    return std::make_shared<const BurialRecord>(std::move(record_));
  }

  /// A few samples may all miss a narrow strip: look closer beside leaves where something was buried.
  void refineBorders() {
    std::vector<bool> done(patches_.leaves.size() * 2, false);
    const auto slot = [&](const Contact& c) { return std::size_t{2} * leaves_.leafOf(c) + c.side; };
    for (const BuriedPart& change : changes_) done[std::size_t{2} * change.leaf + change.side] = true;
    const std::vector<Contact> buried = std::exchange(touched_, {});
    std::vector<bool> in_contact(patches_.leaves.size() * 2, false);
    for (const Contact& c : contacts_) in_contact[slot(c)] = true;
    std::vector<Contact> beside;
    for (const Contact& c : buried) {
      const Surface& surface = patches_.surfaces[c.surface];
      for (std::uint32_t y = c.y == 0 ? 0 : c.y - 1; y < std::min(c.y + 2, surface.height); ++y)
        for (std::uint32_t x = c.x == 0 ? 0 : c.x - 1; x < std::min(c.x + 2, surface.width); ++x) {
          const Contact neighbour{c.surface, c.side, x, y};
          if (done[slot(neighbour)] || !in_contact[slot(neighbour)]) continue;
          done[slot(neighbour)] = true;
          beside.push_back(neighbour);
        }
    }
    places_.beside = affordableBeside(beside.size(), places_, tried_);
    if (places_.beside > places_.few) measureAll(beside, places_.beside, BurialRecord::Pass::kMany);
  }

  /// Both sides share a leaf's point: the front's visible point, or the back's where the front is buried.
  void settleSides() {
    std::ranges::stable_sort(changes_, [](const BuriedPart& a, const BuriedPart& b) {
      return a.leaf != b.leaf ? a.leaf < b.leaf : a.side < b.side;
    });
    for (std::size_t i = 0; i < changes_.size(); ++i) {
      BuriedPart& change = changes_[i];
      const bool both = i + 1 < changes_.size() && changes_[i + 1].leaf == change.leaf;
      const auto surface = surfaceOf(change.leaf);
      const auto& sides = patches_.surfaces[surface].first_node;
      const bool two_sided = sides[0] != kNone && sides[1] != kNone;
      LeafPoint& point = patches_.leaves[change.leaf];
      point.beneath = record_.covered[surface];
      // Of a side that has lost all nobody asks where it is: the other keeps its places.
      if (!both && two_sided && change.point.triangle == kNone) continue;
      point.full = false;
      BuriedPart& open = both && change.point.triangle == kNone ? changes_[i + 1] : change;
      if (both) ++i;
      if (open.point.triangle != kNone) {
        point = open.point;
        point.cut = true;
        point.beneath = record_.covered[surface];
        keepSpots(patches_, point, open.visible);
      } else if (both || !two_sided) {
        point = {};
        point.beneath = record_.covered[surface];
      }
    }
  }

  [[nodiscard]] std::uint32_t surfaceOf(std::uint32_t leaf) const {
    const auto after = std::ranges::upper_bound(patches_.surfaces, leaf, {}, &Surface::first_leaf);
    return static_cast<std::uint32_t>(after - patches_.surfaces.begin() - 1);
  }

  PatchScene& patches_;
  const std::vector<LeafPiece>& pieces_;
  const Solids& solids_;
  const Coincidence& coincidence_;
  const FormerBurial* former_;
  const std::size_t looks_;  ///< for what comes near a node
  const LeafBurial leaves_;
  BurialRecord record_;
  std::size_t recorded_bytes_ = 0, undecided_ = 0;
  bool is_too_much_ = false;
  std::vector<Contact> contacts_, touched_;
  std::vector<BuriedPart> changes_;
  std::vector<TriedLeaf> tried_;
  BurialPlaces places_;
};

}  // namespace

std::shared_ptr<const BurialRecord> removeBuried(PatchScene& patches, const std::vector<LeafPiece>& pieces,
                                                 const std::vector<Hides>& hides, const FindFormerBurial& find_former) {
  Coincidence coincidence(patches);
  std::unique_ptr<const Solids> solids;
  std::unique_ptr<const FormerBurial> former;
  const auto prepare = [&](std::size_t part) {  // each reads what none of them writes
    if (part == 0) coincidence.run();
    if (part == 1) solids = std::make_unique<const Solids>(patches, hides);
    if (part == 2) former = find_former();
  };
  inTurns(3, prepare);
  auto record = Burial(patches, pieces, hides, *solids, coincidence, former.get()).run();
  coincidence.keepCovered();
  return record;
}

}  // namespace radiosity::scene
