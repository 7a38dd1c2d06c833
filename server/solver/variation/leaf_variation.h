// Light that varies within a leaf. A leaf shoots its mean, so what sees only a part of it, or that part from near by,
// gets too much or too little where its light changes within it: at the foot of something, along a gap, beside the rim
// of a lamp. No sample of links can tell. Rays can: from points of receivers to points y of leaves near by, and from
// there and from another point of the same leaf the same way on. What y has more than that other point varies inside
// the leaf, and is what the receiver lacks; where light is even nothing is left, and no noise.
//
// What it comes to is stated (ErrorParts::variation), and where it matters and is known well enough it is added to what
// receivers have over links: a gather over texels, for those that need it. Paths depend on geometry and on which lights
// shine; light and reflectance are put in with each update. Owned by LinkedSolver; one thread outside of the calls.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <span>
#include <vector>

#include "server/solver/edits/shadows.h"
#include "server/solver/lamps/punctual_lights.h"
#include "server/solver/lamps/sky_sources.h"
#include "server/solver/patches/lights.h"
#include "server/solver/rays/leaf_rays.h"
#include "server/solver/reflected/leaf_sights.h"

namespace radiosity::solver {

/// Light as the paths see it. By leaf value, lux.
struct LeafLight {
  std::span<const glm::vec3> emission;  ///< of what is no light polygon
  std::span<const glm::vec3> reflectance;
  std::array<std::span<const glm::vec3>, 2> irradiance;  ///< by half
  std::span<const LightPolygon> lights;                  ///< dark ones too; more may come, none goes
  std::span<const PunctualLights::Source> sources;
  /// Null: reflected light does not come by rays, which know what varies where a leaf is parted.
  const LeafSights* sights = nullptr;
  const SkyLight* sky = nullptr;                          ///< null: black
  std::array<std::span<const glm::vec3>, 2> passed = {};  ///< through translucent leaves, lm/m^2; empty: nothing does
};

class LeafVariation {
 public:
  /// `rays`: of the same two, where there are some already.
  LeafVariation(const scene::PatchScene& patches, const std::vector<Side>& sides, std::uint64_t seed,
                std::shared_ptr<const LeafRays> rays = nullptr);

  /// What the paths of the scene before tell of those of a leaf.
  enum class Tells : std::uint8_t {
    kNothing,  ///< it is new, moved or altered
    kByWay,    ///< something changed within nearest() of it: of those alone whose ways to there do not pass it
    kAll,      ///< nothing did: where no leaf was near, none is
  };
  /// After an edit of geometry, before the first update(): what the paths of the scene before have found.
  /// `value_before`: by leaf value, what it was there, or kNone. What they do not tell is traced anew, so that paths
  /// are the same as without it but for how many there are. `change`, where the same `lights` were there before, in the
  /// same places: paths of which no way passes it are taken over, unless other lights shine by then. Without it
  /// kByWay is kNothing.
  void inherit(const LeafVariation& former, std::span<const std::uint32_t> value_before, std::span<const Tells> tells,
               const Shadows* change = nullptr, std::span<const LightPolygon> lights = {});
  /// Farther from a leaf than this (unit box) nothing is near to it.
  [[nodiscard]] double nearest() const;

  /// Brings all that is below up to date with the light. Paths are traced when there are none, and followed to the
  /// lights again when others shine; more are traced until what varies is known to be little beside `bound`, an
  /// irradiance squared times area as below, or is found to be more. Below the bound nothing is corrected. After so
  /// many seconds of tracing, about, it returns false: it is to be called again, and goes on; what it comes to in the
  /// end does not depend on that.
  [[nodiscard]] bool update(const LeafLight& light, double bound, double seconds);
  void update(const LeafLight& light, double bound) { (void)update(light, bound, kNoEnd); }

  /// What it corrects is of another light: it corrects nothing until the next update().
  void forgetCorrections();
  /// More paths for those receivers where they help most; update() is to follow. False: there are as many as there may
  /// be.
  [[nodiscard]] bool refine();

  // Sums over leaves and channels of area (unit box squared) times irradiance (lux) squared.
  /// Of what varies and is not corrected; never below zero. Nothing where it is within the noise, and below the bound.
  /// After refinement, which stops where noise seems small by chance, this and noise() come out a quarter too small, an
  /// eighth of an error.
  [[nodiscard]] double left() const { return left_; }
  /// Of the noise of the corrections in the mean of the halves.
  [[nodiscard]] double noise() const { return noise_; }
  /// Of what more paths would lower: that noise, the noise that hides what varies, and what is left where it is not
  /// because it is doubtful.
  [[nodiscard]] double unsettled() const { return noise_ + unknown_ + std::max(0.0, left_ - doubtful_); }

  /// Whether corrections were looked for: what varies is no less than the bound.
  [[nodiscard]] bool corrects() const { return corrects_; }
  /// To be added to irradiance, lux, by half: these are independent but for how much of them is.
  struct Correction {
    std::uint32_t value;  ///< leaf value
    std::array<glm::vec3, 2> lacks;
    bool operator==(const Correction&) const = default;
  };
  /// By ascending leaf value; nothing elsewhere.
  [[nodiscard]] std::span<const Correction> corrections() const { return corrections_; }

  /// How many paths each receiver has; the paths are traced anew from it.
  template <typename Archive, typename Self>
  static void visit(Archive& archive, Self& self) {
    archive(self.count_);
  }
  /// Whether what visit() read fits.
  [[nodiscard]] bool isWhole() const;

 private:
  using Place = LeafRays::Place;
  /// A way from a receiver over a leaf near by, and from another place of that.
  struct Path {
    std::uint32_t receiver = 0;                       ///< leaf value
    std::uint32_t by = 0;                             ///< leaf value of the leaf near by
    std::array<std::uint32_t, 2> seen{};              ///< leaf values that its two places see
    float light_factor = 0.0F, source_factor = 0.0F;  ///< what the first place has of them more than the second
    std::uint16_t light = 0, source = 0;              ///< one of each
    std::uint16_t index : 15 = 0;                     ///< which one of the receiver's, in its half
    std::uint16_t sees_near : 1 = 0;                  ///< one of `seen` is near, and may vary within itself
  };
  /// Of a path: what it has of the lights that shine.
  struct Lit {
    std::uint16_t light, source;
    float light_factor, source_factor;
  };
  /// Irradiance that a receiver lacks: what is sure, and what comes over a second leaf near by, of whose light the mean
  /// is known. In a gap between bright surfaces that may be as wrong as what it is to correct.
  struct Lack {
    glm::vec3 sure{0.0F}, doubtful{0.0F};
  };
  /// What light comes to one of two places, and which of all is followed: drawn in proportion to what it would bring
  /// without shadows.
  struct Drawn {
    std::uint32_t index = scene::kNone;
    std::array<double, 2> unhidden{};
    double chance = 0.0;
  };
  /// A receiver is to have paths first .. end - 1.
  struct Task {
    std::uint32_t receiver, first, end;
    bool operator==(const Task&) const = default;
  };

  [[nodiscard]] static std::uint64_t numberOf(std::uint32_t receiver, std::uint32_t index) {
    return std::uint64_t{receiver} << 16U | index;
  }
  [[nodiscard]] bool isNear(const LeafRays::Sight& sight) const;
  static constexpr double kNoEnd = 1e30;  ///< seconds
  using Clock = std::chrono::steady_clock;
  /// Paths that are traced, but not yet among the others, since not all that were asked for are.
  struct UnderWay {
    std::vector<Task> tasks;
    std::uint64_t lights = 0;                                  ///< which shine
    std::vector<std::array<std::vector<Path>, 2>> found = {};  ///< by share of the tasks and half
    std::size_t done = 0;                                      ///< shares
  };
  [[nodiscard]] bool traceAll(const LeafLight& light, Clock::time_point end);
  [[nodiscard]] bool trace(std::span<const Task> tasks, const LeafLight& light, Clock::time_point end);
  void follow(const Task& task, std::size_t half, const LeafLight& light, std::vector<Path>& paths) const;
  void followLights(const std::array<Place, 2>& places, std::uint64_t key, const LeafLight& light, Path& path) const;
  void takeOtherLights(const LeafLight& light, std::uint64_t shining);
  void followOtherLights(const LeafLight& light, std::size_t half, std::size_t first);
  /// Of the scene before: a path that there was, or that there may be by now.
  struct Known {
    std::uint64_t number = 0;           ///< numberOf()
    std::uint32_t kept = scene::kNone;  ///< into kept_, where it is what it was; otherwise there may be none any more
  };
  /// Whether the scene before tells whether there is such a path.
  [[nodiscard]] bool isKnown(std::uint32_t receiver, std::uint32_t index) const {
    return !known_.empty() && index < known_[receiver];
  }
  using KnownOnes = std::span<const Known>;
  [[nodiscard]] KnownOnes knownFrom(std::uint32_t receiver, std::size_t half) const;
  void askWays(std::size_t half, std::span<const Tells> tells, const Shadows& change);
  void keepPaths(const LeafVariation& former, std::size_t half, std::span<const std::uint32_t> value_after,
                 std::span<const Tells> tells, const Shadows* change, std::span<const LightPolygon> lights);
  [[nodiscard]] bool passesNothing(const Path& path, std::size_t half, const Shadows& change,
                                   std::span<const LightPolygon> lights) const;
  void forgetFormer();
  /// From a receiver; and where the other place of the leaf that it meets lies on that.
  struct Way {
    Place from;
    glm::dvec3 direction;
    glm::dvec2 at;
  };
  [[nodiscard]] Way firstWay(std::uint32_t receiver, std::uint64_t key) const;
  [[nodiscard]] bool findPlaces(std::uint32_t receiver, std::uint64_t key, std::array<Place, 2>& places) const;
  /// Of the draws of a path.
  [[nodiscard]] std::uint64_t keyOf(std::uint32_t receiver, std::uint32_t index, std::size_t half) const;
  [[nodiscard]] static glm::dvec3 wayOn(std::uint64_t key, const Place& from);
  [[nodiscard]] static glm::dvec3 pointOn(const LightPolygon& lamp, std::uint64_t key);
  template <typename Unhidden>
  [[nodiscard]] static Drawn draw(std::size_t count, std::uint64_t key, const Unhidden& unhidden);
  void followLight(const std::array<Place, 2>& places, std::uint64_t key, const LeafLight& light, Path& path) const;
  void followSource(const std::array<Place, 2>& places, std::uint64_t key, const LeafLight& light, Path& path) const;
  [[nodiscard]] Lack lacking(const Path& path, const LeafLight& light, std::size_t half) const;
  void sumUp(const LeafLight& light);
  void correct();
  void weigh(const Side& side);
  [[nodiscard]] std::vector<Task> twiceAsMany() const;

  const std::vector<Side>& sides_;
  std::shared_ptr<const LeafRays> rays_;
  std::uint64_t seed_;
  std::vector<std::uint32_t> receivers_;  ///< leaf values, ascending
  double stands_for_ = 1.0;               ///< leaves, for each receiver
  std::vector<std::uint16_t> count_;      ///< paths of each half, by receiver; empty: none were traced yet
  std::uint64_t traced_for_ = 0;          ///< which lights
  bool is_traced_ = false;                ///< as many paths as count_ says
  std::vector<Task> wanted_;              ///< by refine()
  UnderWay under_way_;
  std::array<std::vector<Path>, 2> paths_;      ///< by half
  std::array<std::vector<Lit>, 2> lit_before_;  ///< of the first of them: by lights that shone before
  std::uint64_t lit_before_for_ = 0;            ///< which
  // After an edit of geometry, until paths are traced:
  std::vector<std::uint16_t> known_;          ///< by leaf value: of so many paths it is known which there are; or empty
  std::array<std::vector<Known>, 2> there_;   ///< by half: these, ascending
  std::array<std::vector<Path>, 2> kept_;     ///< and those that are what they were, ...
  std::uint64_t kept_for_ = 0;                ///< ... by these lights
  std::array<std::vector<Lack>, 2> lacking_;  ///< by half and leaf value: mean of the paths; while updating
  bool corrects_ = false;                     ///< what varies was worth it, though nothing may be sure enough
  std::vector<Correction> corrections_;
  std::vector<float> gain_;               ///< by leaf value: what more paths would lower; while correcting
  double found_ = 0.0, deviation_ = 0.0;  ///< sum of what varies, and its standard deviation
  double left_ = 0.0, noise_ = 0.0, unknown_ = 0.0, doubtful_ = 0.0;
};

}  // namespace radiosity::solver
