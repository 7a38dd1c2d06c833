// Measures some columns of links again, all at once: those of their links that pass what an edit changed. Each column
// is the mean of its samples, so all of them are taken again, but only for the leaves that need it; how much should
// arrive in all is known without the others, unless much is lost. Lives for one slice of EditRepair; one thread.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "common/result.h"
#include "server/solver/repair/repair.h"

namespace radiosity::solver {

class RepairBatch {
 public:
  /// `repairs` and `counters`, of what repairs do, are written to.
  RepairBatch(const LinkParts& parts, const RepairRules& rules, const EditShadows& shadows, std::span<Repair> repairs,
              LinkCounters& counters);

  /// Takes the shots and replaces the links. Errors: the transport's.
  [[nodiscard]] Result<TransportCounters> measure();

  /// Repairs of which so much is lost that they are to be taken again as a whole.
  [[nodiscard]] std::span<const Repair> anew() const { return anew_; }
  /// Of lights, of which other points are to look later.
  [[nodiscard]] std::span<Repair> rough() { return rough_; }
  /// Where the i-th of these looked.
  [[nodiscard]] std::span<const LinkColumn::ValueRun> leavesOfRough(std::size_t i) const {
    return leaves_[leaves_of_rough_[i]];
  }
  /// Zeros, one for each leaf value: room to work in, which is to be zeros again.
  [[nodiscard]] std::span<float> room() { return sum_; }

 private:
  struct Sample {
    std::uint32_t repair, points;
    bool first, last;
  };
  void updateSamples();
  void findCutLinks();
  void addShots();
  void addShotsOf(std::uint32_t r, std::size_t boxes);
  [[nodiscard]] bool losesLittle(const Repair& repair) const;
  void take(std::size_t shot, LinkSample& links);
  void addPart(const Sample& sample, const LinkSample& links);
  void replaceLinks(std::uint32_t index);
  void keepRough(std::uint32_t index);

  const LinkParts& parts_;
  const RepairRules& rules_;
  const EditShadows& shadows_;
  std::span<Repair> repairs_;
  LinkCounters& counters_;
  std::vector<std::vector<LinkColumn::ValueRun>> leaves_;  // by repair: those to be taken again; unused where whole
  ShotBatch shots_;
  std::vector<Sample> gathered_, scattered_;
  std::vector<float> sum_;     // by leaf value: of the repair on its way, links times points
  std::uint32_t points_ = 0;   // with those that looked before
  LinkColumn::Totals totals_;  // times points
  bool is_open_ = false;       // so much is lost that only the sum of all links tells what arrives
  std::vector<Repair> anew_, rough_;
  std::vector<std::uint32_t> leaves_of_rough_;  // into leaves_
};

}  // namespace radiosity::solver
