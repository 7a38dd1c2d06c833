// Shooters, the links that were measured of them, and the radiosity equation among them: lamps, and nodes so bright
// that rays would find them too seldom. Each shoots a uniform radiosity over its links, and all bounces between them
// are solved without another image.
//
//   b_m = e_m + mean over node m of rho sum_n T_n w_n b_n
//
// and, of what is translucent, likewise of tau and the links to the other side,
//
// where T_n are the links of shooter n to leaves, and w_n its roulette weight. What leaves have beside, LeafGather
// brings.
//
// Solved by GMRES around sweeps of Gauss and Seidel, which are progressive shooting on few unknowns (Cohen and others
// 1988). Two independent halves of all links give two independent solutions, whose difference is the sampling error.
// Owned by LinkedSolver; one thread outside of the calls.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <span>
#include <vector>

#include "server/solver/math/gmres.h"
#include "server/solver/patches/passing.h"
#include "server/solver/patches/side.h"
#include "server/solver/transport/link_column.h"
#include "server/solver/transport/link_tint.h"

namespace radiosity::solver {

struct Shooter {
  NodePlace place;                      ///< of a node; of a light only one of the following three counts
  std::uint32_t light = scene::kNone;   ///< index of the light polygon, or kNone
  std::uint32_t source = scene::kNone;  ///< index of the light without extent, or kNone; `area` is its flux for one
  std::uint32_t crowd = scene::kNone;   ///< index of the crowd of lamps, or kNone; `area` is its flux for one
  bool certain = false;                 ///< never plays roulette
  std::uint32_t resolution = 0;         ///< N of a node's item buffers
  double area = 0.0;                    ///< that shines, unit box squared
  std::array<LinkColumn, 2> column;     ///< by half
  /// By half: of what comes through coloured glass; null: all has its own colour. Not saved. The equation among
  /// shooters does without: where rays gather, what nodes have less than they shoot is sent again, negative.
  std::array<std::shared_ptr<const LinkTint>, 2> tint;
  std::array<double, 2> weight{1.0, 1.0};  ///< 0: does not play in that half
  std::array<glm::vec3, 2> mean{};         ///< b: mean radiosity of the node
  std::array<glm::vec3, 2> sent{};         ///< the same as it is shot, before the weight

  std::size_t most_bytes = 0;        ///< that a column can come to take
  double sample_cost = 0.0;          ///< of a source or crowd, in a node's samples from one point
  std::array<double, 3> products{};  ///< sums over leaves of area T0 T0, T0 T1, T1 T1

  [[nodiscard]] bool isLight() const {
    return light != scene::kNone || source != scene::kNone || crowd != scene::kNone;
  }
  /// A light whose links are still to be measured, in one half at least.
  [[nodiscard]] bool owes() const {
    return isLight() && power() > 0.0 && (column[0].points() == 0.0 || column[1].points() == 0.0);
  }
  /// Radiosity that its own links carry.
  [[nodiscard]] double carried(std::size_t half) const { return weight[half]; }
  /// Flux it shoots, all channels, mean of the halves and before roulette.
  [[nodiscard]] double power() const;
  /// Variance that it brings to irradiance: area-weighted square of the difference between what its halves deliver.
  [[nodiscard]] double spread() const;
};

class LinkSystem {
 public:
  LinkSystem(const scene::PatchScene& patches, const std::vector<Side>& sides);

  /// Entries of the matrix stay unless they hold a reflectance or transmittance that changed. `transmittance`: empty
  /// where nothing is translucent.
  void setMaterials(const scene::SideColours& emission, const scene::SideColours& reflectance,
                    const scene::SideColours& transmittance = {});
  [[nodiscard]] const scene::SideColours& emission() const { return emission_; }
  [[nodiscard]] const scene::SideColours& reflectance() const { return reflectance_; }
  [[nodiscard]] const scene::SideColours& transmittance() const { return transmittance_; }
  /// All leaves that let light through (passing.h).
  [[nodiscard]] std::span<const PassingLeaf> passing() const { return passing_; }
  /// Whether light that arrives on the other side leaves here.
  [[nodiscard]] bool letsThrough(const Side& side) const;
  /// Unit box squared, by leaf value.
  [[nodiscard]] std::span<const float> leafAreas() const { return leaf_area_; }

  /// Index of the new shooter. No node above or below it may be one.
  std::uint32_t add(const Shooter& shooter);
  [[nodiscard]] std::vector<Shooter>& shooters() { return shooters_; }
  [[nodiscard]] const std::vector<Shooter>& shooters() const { return shooters_; }
  /// The shooter at exactly this node of a side, or kNone.
  [[nodiscard]] std::uint32_t at(std::uint32_t side, std::uint32_t node) const {
    const auto known = nodes_[side].empty() ? kNobody : nodes_[side][node - sides_[side].first_node] & ~kHasBelow;
    return known == kNobody ? scene::kNone : known;
  }
  /// Whether shooters lie below this node of a side.
  [[nodiscard]] bool hasBelow(std::uint32_t side, std::uint32_t node) const {
    return !nodes_[side].empty() && (nodes_[side][node - sides_[side].first_node] & kHasBelow) != 0;
  }

  /// Averages a new sample into the links of a shooter. What it delivers, loses and lets escape is brought to exactly
  /// what the shooter sends where only rounding lies between.
  void addSample(std::uint32_t shooter, std::size_t half, const LinkExpander& links, const LinkSample& totals,
                 double points);

  /// Other links to some leaves, as LinkColumn::replace.
  void replaceLinks(std::uint32_t shooter, std::size_t half, std::span<const LinkColumn::ValueRun> leaves,
                    std::span<const float> values, const LinkColumn::Totals& totals);

  /// Forgets its links, so that its place can be taken by another light.
  void forget(std::uint32_t shooter);
  /// The links of one half.
  void forget(std::uint32_t shooter, std::size_t half);

  /// After an edit of geometry: what of the matrix is as it was. By shooter: its number in the former system, where the
  /// leaves of its node are what they were, and by half, where the links of its column are; else kNone.
  struct FormerEntries {
    std::vector<std::uint32_t> row;
    std::array<std::vector<std::uint32_t>, 2> column;
  };
  /// Takes over entries, with the bits that they would be made with. Comes after all shooters, before begin().
  void inheritEntries(const LinkSystem& former, const FormerEntries& same);

  /// Starts to bring rows up to date and to solve both halves, from what was sent before. Nothing else may change
  /// until it is done; begin() may come again at any time, and starts anew.
  void begin();
  /// Goes on for about `seconds`; longer by at most one sweep over all entries, or the links of some shooters. True:
  /// done. Where the cuts lie changes no bit. Throws std::bad_alloc.
  bool advance(double seconds);
  /// All at once. Returns the sweeps that the slower half took.
  int solve();
  /// Sweeps that the slower half took for the last solution.
  [[nodiscard]] int sweeps() const { return std::max(halves_[0].sweeps, halves_[1].sweeps); }
  /// Bound of the relative error that the last solution leaves: flux that its equation does not account for, of the
  /// flux that shines. At most 1e-6 unless the sweeps were used up.
  [[nodiscard]] double unsolved() const;

  /// No shooters are left.
  void clear();
  /// Irradiance of every leaf value from the solution of `half`, or what of it comes straight from lights, or from
  /// those of them that are no surfaces.
  enum class From { kAll, kLights, kSources };
  void irradiance(std::size_t half, std::vector<glm::vec3>& values, From from = From::kAll) const;
  /// Square of the error of the mean of the halves that their tints leave: sum over leaves and channels, times area.
  [[nodiscard]] double tintNoise() const;
  /// What all links take.
  [[nodiscard]] std::size_t bytes() const;
  /// Rows of the equation in each half, and how many a node of the side has.
  [[nodiscard]] std::size_t rowCount() const { return halves_[0].matrix.size(); }
  [[nodiscard]] std::size_t rowsOf(std::uint32_t side) const { return uniform_[side] ? 1 : 3; }
  /// Between two solutions. The matrix is not saved: begin() makes it again from the links, with the same bits.
  void save(ArchiveWriter& to) const;
  /// Takes the place of all that is there. False: it is of another scene.
  [[nodiscard]] bool restore(ArchiveReader& from);
  /// Radiosity that stands for each leaf of a side: that of the deepest shooter above it, mean of the halves.
  void standIn(std::uint32_t side, std::vector<glm::vec3>& leaves) const;

 private:
  struct Rows {
    std::uint32_t first = 0, count = 0;  ///< one if the node is of one reflectance and opaque, else one a channel
  };
  struct Half {
    std::vector<std::vector<float>> matrix;  ///< by row: entries by column
    Gmres<double> gmres;
    Gmres<double>::Vectors sent, mean;  ///< of the sweep under way; weights included
    std::array<double, 3> shining{};
    double area = 0.0;
    int attempt = 0, sweeps = 0;
    double unsolved = 0.0;
    bool done = true;
  };
  [[nodiscard]] bool isPlace(const NodePlace& place) const;
  [[nodiscard]] double areaOf(const Shooter& shooter) const;
  /// By which what a sample delivers, loses and lets escape is multiplied.
  [[nodiscard]] static double roundingOf(const Shooter& shooter, double due, double escaped, double absorbed);
  void noteChange(std::uint32_t shooter, std::size_t half);
  void updateMeans();
  void makeRows();
  [[nodiscard]] bool hasRow(std::uint32_t shooter) const {
    return shooter < known_ && (no_row_.empty() || !no_row_[shooter]);
  }
  [[nodiscard]] bool hasSameReflectance(std::uint32_t member, const LinkSystem& former, std::uint32_t old_member) const;
  void updateColumns(std::size_t half, std::uint32_t first, std::uint32_t end);
  /// Links to the leaves of a side, and to those of its other side where that lets light through; null: there are none.
  struct SideLinks {
    const float *own = nullptr, *beyond = nullptr;
  };
  void fillRow(std::size_t half, std::uint32_t member, std::uint32_t column, const SideLinks& links);
  void beginHalf(std::size_t half);
  void advanceHalf(std::size_t half);
  void sweep(std::size_t half, Gmres<double>::Vectors& sent, bool affine);
  [[nodiscard]] bool isPhysical(const Half& half) const;
  void take(std::size_t half);
  void lowerWeights(std::size_t half, double most);

  const scene::PatchScene& patches_;
  const std::vector<Side>& sides_;
  std::vector<Shooter> shooters_;
  std::vector<Rows> rows_;                                   // by shooter
  std::vector<glm::vec3> emission_mean_, reflectance_mean_;  // by shooter
  static constexpr std::uint32_t kHasBelow = 1U << 31U, kNobody = kHasBelow - 1;
  /// By side and node: its shooter or kNobody, and whether there are some below. Empty: the side has none.
  std::vector<std::vector<std::uint32_t>> nodes_;
  std::vector<std::vector<std::uint32_t>> members_;  // nodes by side
  std::array<std::vector<bool>, 2> changed_;         // by half, by shooter: its column's entries are stale
  std::vector<bool> no_row_;                         // by shooter: of those below known_; empty: none
  std::size_t known_ = 0;                            // shooters whose rows are there
  std::uint32_t next_column_ = 0;                    // to be brought up to date
  std::array<Half, 2> halves_;
  scene::SideColours emission_, reflectance_, transmittance_;
  std::vector<PassingLeaf> passing_;
  std::vector<float> leaf_area_;  // by leaf value
  std::vector<bool> uniform_;     // by side: of one reflectance, and opaque
};

}  // namespace radiosity::solver
