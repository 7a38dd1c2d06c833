// What colour light has that comes straight from lamps, or from nodes that shine, by way of coloured glass: links bring
// it as if all channels passed as the best does. Leaves look at points of the lamp to find out; two independent halves
// do, so that what chance leaves is in the stated error. Kept by lamp. Owned by LinkedSolver; one thread outside of the
// calls.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <vector>

#include "server/scene/values/patch_scene.h"
#include "server/solver/lamps/crowd.h"
#include "server/solver/lamps/lamp_ball.h"
#include "server/solver/lamps/punctual_lights.h"
#include "server/solver/lamps/unhidden.h"
#include "server/solver/patches/lights.h"
#include "server/solver/patches/side.h"
#include "server/solver/rays/leaf_rays.h"
#include "server/solver/transport/link_tint.h"

namespace radiosity::solver {

class LightTints {
 public:
  /// What sends light over links.
  struct Sender {
    std::uint64_t key = 0;  ///< stays while nothing but the colour of its light changes
    LampBall ball;
    /// One of its points, uniform in [0, 1)^2, and what that brings to a place; only ratios count.
    std::function<SourceLook(const LeafRays::Place&, const glm::dvec2&)> look;
  };
  [[nodiscard]] static Sender of(const LightPolygon& lamp);
  [[nodiscard]] static Sender of(const PunctualLights::Source& source);
  /// Of one that knows its lamps.
  [[nodiscard]] static Sender of(const Crowd& crowd);
  /// Of all leaves under it, each as bright as the others.
  [[nodiscard]] static Sender of(const Side& side, const NodePlace& node, std::shared_ptr<const LeafRays> rays);

  /// Both are to outlive it. `most_bytes`: for all that it keeps; of more than that neighbours have one colour.
  LightTints(const scene::PatchScene& patches, const std::vector<Side>& sides, std::uint64_t seed,
             std::size_t most_bytes);
  /// Whether anything is coloured.
  [[nodiscard]] bool isNeeded() const { return !boxes_.empty(); }

  /// Looks at these from now on. What is known of those that were there before stays known.
  void begin(std::vector<Sender> senders, std::shared_ptr<const LeafRays> rays);
  /// From the next begin() on each leaf that sees several colours looks about `times` as often, a power of two, at most
  /// kMostTimes in all. False: it does so already.
  bool refine(double times);
  static constexpr std::uint32_t kMostTimes = 64;
  /// More looks are asked for than were made.
  [[nodiscard]] bool isBehind() const {
    return std::ranges::any_of(known_, [&](const Known& known) { return known.times != times_; });
  }
  /// Those are given up. Not between begin() and the end of advance().
  void giveUp() {
    for (const auto& known : known_) times_ = known.times;
  }
  /// Goes on for about `seconds`, on all cores: until it is true. Where the cuts lie changes nothing.
  bool advance(double seconds);
  /// After that, by number of the sender; null: all of its light has its own colour.
  [[nodiscard]] std::shared_ptr<const LinkTint> tint(std::size_t sender, std::size_t half) const {
    return known_[sender].tint[half];
  }

 private:
  struct Known {
    std::uint64_t key = 0;
    std::uint32_t times = 0, block = 0;  ///< of the latter: leaves in a row, or rows, of one colour; 0: not known yet
    bool is_whole = false;
    std::array<std::shared_ptr<const LinkTint>, 2> tint;
  };
  /// Rows of a side, first to end - 1, of whose leaves some may see the sender through coloured glass.
  struct Rows {
    std::uint32_t side, first, end;
  };
  [[nodiscard]] bool mayTint(const Sender& sender, const glm::dvec3& centre, double radius) const;
  [[nodiscard]] bool mayTint(const Sender& sender, const Side& side) const;
  void plan();
  void finish();
  [[nodiscard]] std::array<LinkTint, 2> lookFrom(const Rows& rows) const;
  [[nodiscard]] LinkTint lookFrom(const Rows& rows, std::size_t half) const;
  /// What looks see, maybe through glass of several colours, or through none.
  struct Seen {
    double part = 0.0;
    glm::dvec3 light{0.0}, least{1.0}, most{0.0};

    void add(double brings, const LeafRays::Passage& passage);
    [[nodiscard]] bool differs() const;
    [[nodiscard]] glm::dvec3 tint() const { return light / part; }
  };
  [[nodiscard]] std::uint64_t keyOf(std::uint32_t value, std::size_t half) const;
  void look(std::uint32_t value, std::uint64_t key, std::uint32_t first, std::uint32_t end, Seen& seen) const;
  [[nodiscard]] std::optional<glm::vec3> ask(std::uint32_t value, std::size_t half, bool is_edge, Seen seen) const;

  const scene::PatchScene& patches_;
  const std::vector<Side>& sides_;
  std::uint64_t seed_;
  std::size_t most_bytes_;
  std::vector<scene::ChangedBox> boxes_;  ///< around what is coloured
  std::shared_ptr<const LeafRays> rays_;
  std::vector<Sender> senders_;
  std::vector<Known> known_;                    ///< as these
  std::uint32_t times_ = 1;                     ///< as many looks as at first
  std::size_t at_ = 0;                          ///< of senders: all before are whole
  std::vector<Rows> pending_;                   ///< of the sender there; empty: not planned yet
  std::vector<std::array<LinkTint, 2>> parts_;  ///< as these
  std::size_t next_ = 0;                        ///< of these
};

}  // namespace radiosity::solver
