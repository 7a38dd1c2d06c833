// Reflected light gathered at the leaves, over the leaves that rays from there see (LeafSights): the radiosity equation
// on leaves,
//
//   x = R (r + rho x),
//
// where r is the radiosity of each leaf that no shooter stands for, and of the sky, and R the mean over a leaf's rays.
// So light comes
// over links from whatever is worth an image of its own, and from all else by rays, and nothing comes twice: what
// shooters send less than a leaf has, or more, is in r, signed. Translucent leaves send tau x of their other side, too.
// In rooms of hundreds of surfaces a ray to each sample costs less than an image of all of them from each. Rays see
// leaves as they are, so that nothing varies within a shooter, and what is near, or half hidden, needs no care of its
// own.
//
// Solved by GMRES. What is sent and does not leave the scene arrives: of each part of the scene that sees nothing of
// the others the level of x, which rays know to a thousandth or so, is the one that makes it so.
//
// Of a ray that a mirror reflected the leaf at the mirror counts by itself, and what is seen in it times what the
// mirror reflects: there shooters count as well, since what they send over links does not come by way of mirrors. Lamps
// in mirrors are looked for by other means (MirroredLamps), and not by those rays that would find them there.
//
// Two independent halves of the rays give two independent solutions; where their difference is worth
// more rays than it is elsewhere, leaves get more. Owned by LinkedSolver; one thread outside of the calls.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "common/union_find.h"
#include "server/solver/math/gmres.h"
#include "server/solver/patches/passing.h"
#include "server/solver/reflected/leaf_shading.h"
#include "server/solver/reflected/leaf_sights.h"
#include "server/solver/reflected/leaf_smoother.h"
#include "server/solver/reflected/lost_rays.h"
#include "server/solver/reflected/mirrored_lamps.h"
#include "server/solver/reflected/shaded_rays.h"

namespace radiosity::solver {

/// Light as shooters left it. By leaf value; lux, and lm/m^2.
struct LeftLight {
  std::vector<glm::vec3> emission;  ///< of what is no light polygon
  std::vector<glm::vec3> reflectance;
  std::vector<PassingLeaf> passing;                         ///< in their order
  std::shared_ptr<const SpecularLeaves> mirrors = nullptr;  ///< as of LeafGather::reflectBy()
  std::vector<glm::vec3> lamps;                             ///< emission of light polygons; empty: no mirror needs it
  std::vector<glm::vec3> imaged_lamps;  ///< of it, of those of `in_mirrors`; empty where there are none
  /// In those mirrors: of some of `lamps`, and of lights that are no surfaces.
  MirroredLamps::Lamps in_mirrors;
  std::array<std::vector<glm::vec3>, 2> irradiance;  ///< over links, by half
  std::array<std::vector<glm::vec3>, 2> shot;        ///< radiosity that shooters stand for, by half
  std::array<glm::dvec3, 2> sky{};                   ///< pi times its radiance, above the horizon and below
  std::vector<glm::vec3> sky_cells;                  ///< the same by cell of SkyCells, to be added; empty: none
  double residual = 4e-4;                            ///< that may be left, of all that is gathered
};

class LeafGather {
 public:
  /// `most_bytes`: for all that it remembers; rays that would take more are not asked for.
  /// `rays`: as of LeafSights. `areas`: leafAreas(), which are to outlive it; empty: it finds them itself.
  LeafGather(const scene::PatchScene& patches, const std::vector<Side>& sides, std::uint64_t seed,
             std::size_t most_bytes, std::shared_ptr<const LeafRays> rays = nullptr, std::span<const float> areas = {});
  LeafGather(const LeafGather&) = delete;
  LeafGather& operator=(const LeafGather&) = delete;

  /// What the equation takes at most, without rays, and with those that a solve begins with.
  [[nodiscard]] static std::size_t leastBytes(std::size_t leaves, bool has_mirrors = false);

  /// What rays bring is told for these normals, too; null: for none. It is to outlive this.
  void shadeFor(const LeafShading* shading) { shading_ = shading; }
  /// As LeafSights::reflectBy(), before light is brought that knows of them.
  void reflectBy(std::shared_ptr<const SpecularLeaves> mirrors);
  /// By number of LeafShading: what of irradiance(half) counts for the shading normal. Empty: there are none.
  [[nodiscard]] std::span<const glm::vec3> shadedParts(std::size_t half) const { return shaded_part_[half]; }

  /// After an edit of geometry (LeafSights::inherit).
  void inherit(const LeafGather& former, std::span<const std::uint32_t> value_before, const Shadows& change);
  /// Light was brought, once at least.
  [[nodiscard]] bool hasGathered() const { return has_gathered_; }
  /// All leaves get as many as a solve begins with, where there are none; twice as many on wide sides whose light
  /// comes by rays alone, so that nothing hides their noise; at the edges of wide sides, where little is there to
  /// smooth it with, two or four times as many as within. `has_other`: by side, whether there is other light. Where
  /// leaves are few all have as many times as many, a power of two, as `fewest` rays in all, of both halves, allow and
  /// there is memory for.
  void start(const std::vector<bool>& has_other = {}, std::size_t fewest = 0);
  /// Of so many leaves that noise shows as blotches which on fewer would be a shade.
  [[nodiscard]] static bool isWide(const Side& side) { return side.leaf_count >= kWide; }

  /// Brings rays and light up to date, in slices: until advance() is true. The result depends on rays and `light`
  /// alone. Throws std::bad_alloc.
  void begin(LeftLight light);
  bool advance(double seconds);
  /// Rays are asked for that are not traced, or looks at images: advance() will take its time.
  [[nodiscard]] bool isBehind() const { return !sights_.isTraced() || mirrored_lamps_.isBehind(); }
  [[nodiscard]] std::uint64_t raysBehind() const { return sights_.untraced(); }
  /// Rays that finding those lamps in mirrors takes, of which nothing is known.
  [[nodiscard]] std::uint64_t looksBehind(const MirroredLamps::Lamps& lamps) const {
    return mirrored_lamps_.raysFor(lamps);
  }
  /// Where there was no room for what they bring they are to be left out.
  [[nodiscard]] const MirroredLamps& mirroredLamps() const { return mirrored_lamps_; }
  /// Those are given up, where there are others.
  void giveUp() { sights_.giveUp(); }

  /// x, to be added to what came over links. Until it is forgotten.
  [[nodiscard]] std::span<const glm::vec3> irradiance(std::size_t half) const { return gathered_[half]; }
  void forgetIrradiance() {
    gathered_ = {};
    shaded_part_ = {};
  }
  /// Square of the error that rays leave in the mean of the halves: sum over leaves and channels, times area.
  [[nodiscard]] double noise() const { return noise_; }
  /// Of it, but for what smoothing took: more rays lower this part.
  [[nodiscard]] double rayNoise() const { return std::max(0.0, noise_ - smoothed_); }
  [[nodiscard]] double smoothedSquare() const { return smoothed_; }
  /// The part of noise() that the halves have in common: what smoothing took of the light itself, and what neither of
  /// them saw, by the light that is sent and does not arrive.
  [[nodiscard]] double bias() const { return bias_; }
  /// bias() and doubt() by leaf value, not times area.
  [[nodiscard]] std::span<const float> biasOfLeaves() const { return leaf_bias_; }
  /// The same of what no ray can tell: they end within a gap that has no end. No part of noise().
  [[nodiscard]] double doubt() const { return doubt_; }
  /// Flux that the equation does not account for, of what shines: so much of all light at most, however often it is
  /// reflected, where all reflect alike; up to four times as much beside lamps in a dark room.
  [[nodiscard]] double unsolved() const { return unsolved_; }
  /// And the square of the error that this makes, as Gmres::errorOfShape() tells it: sum over leaves and channels,
  /// times area. What all leaves of a part of the scene lack alike, of which that knows nothing, levels() put right.
  [[nodiscard]] double unsolvedSquare() const { return unsolved_square_; }
  /// Flux that leaves the scene, and that falls on unlit sides, by channel: of what leaves send.
  [[nodiscard]] const std::array<double, 3>& escapedFlux() const { return escaped_; }
  [[nodiscard]] const std::array<double, 3>& absorbedFlux() const { return absorbed_; }
  /// Flux that mirrors reflect, each time that they do, but for what leaves the scene as it came from it.
  [[nodiscard]] const std::array<double, 3>& mirroredFlux() const { return mirrored_flux_; }
  /// Flux that mirrors reflect of images of lights that are no surfaces, as if they did so diffusely.
  [[nodiscard]] const std::array<double, 3>& spreadFlux() const { return spread_; }
  /// Square of the noise of lamps in mirrors, as noise().
  [[nodiscard]] double imageNoise() const { return image_noise_[0] + image_noise_[1]; }
  /// Looks for those more often whose noise is most, so that all of it is about `goal`. False: it is, or there can be
  /// no more.
  bool refineImages(double goal);
  /// Flux that leaves get of images of lights that are no surfaces.
  [[nodiscard]] const std::array<double, 3>& imagedFlux() const { return imaged_flux_; }
  /// Flux that comes straight from the sky, or by way of mirrors.
  [[nodiscard]] const std::array<double, 3>& skyFlux() const { return from_sky_; }

  /// Noise, as parts of the light where it is, that is borne, and that what is not is brought to.
  struct BesideLight {
    double borne = HUGE_VAL, goal = HUGE_VAL;
  };
  /// Asks for more rays: where the noise beside the light is not borne, so that nobody sees it as blotches in what is
  /// dark, and where they lower rayNoise() most for their number, until it is likely to be `goal`. A leaf gets at most
  /// four times as many. False: that is so, or there can be no more.
  [[nodiscard]] bool refine(double goal, const BesideLight& beside);
  /// Whether the last refine() would have asked for more, had there been room for them.
  [[nodiscard]] bool lacksMemory() const { return lacks_memory_; }
  /// Part of noise() that is left when there are so many times as many rays.
  [[nodiscard]] static double noiseLeft(double times);
  /// How many times as many leave so much of it; at least 1.
  [[nodiscard]] static double timesFor(double left);
  [[nodiscard]] std::uint64_t rays() const;
  [[nodiscard]] const LeafSights& sights() const { return sights_; }

  /// How many rays there are; they are traced anew from it.
  void save(ArchiveWriter& to) const;
  [[nodiscard]] bool restore(ArchiveReader& from);

 private:
  /// What is known of the noise of so many leaves in a row is known of each: single ones are too uncertain to choose
  /// by.
  static constexpr std::uint32_t kBlock = 64;
  static constexpr std::uint32_t kWide = 150;
  /// Four, so that a leaf's are one vector; the last is 0.
  using Light = std::array<double, 4>;
  [[nodiscard]] static Light lightOf(const glm::vec3& light) {
    return {static_cast<double>(light.x), static_cast<double>(light.y), static_cast<double>(light.z), 0.0};
  }
  static void addTo(Light& sum, const Light& light) {
    for (std::size_t c = 0; c < sum.size(); ++c) sum[c] += light[c];
  }
  /// What rays read at random, for each of their ends: half of it lies in the caches.
  using Light32 = std::array<float, 4>;
  using RayGmres = Gmres<float>;
  struct Half {
    std::vector<Light> source;       ///< r; by what may be seen (LeafSights::endCount)
    std::vector<Light32> radiosity;  ///< r + rho x; and then by step
    std::vector<Light32> arriving;   ///< its means
    std::vector<Light32> passed;     ///< tau x of the other side, by leaf; empty: nothing is translucent
    /// By leaf: what its rays bring from the sky where its cells are told apart or mirrors show it; empty: they do not.
    std::vector<Light32> sky;
    std::vector<Light32> mirrored;     ///< by leaf: on how many leaves in mirrors its light arrives; empty: in none
    std::vector<float> at_glass;       ///< by leaf: the part of its rays that meet glass first; empty: none does
    std::vector<float> through_panes;  ///< by leaf: the part that goes through coloured glass first; empty likewise
    std::vector<Light32> shot;         ///< by leaf, what only those in mirrors see: lamps, and what shooters send
    /// By leaf: what of that arrives by rays; and what arrives of images. Empty: nothing.
    std::vector<Light32> in_mirrors;
    std::vector<glm::vec3> imaged;
    RayGmres gmres;
    double shining = 0.0;  ///< flux of |r|, all channels
    bool done = true;
  };
  /// Factors of x, and of what came over links, that x becomes the sum of.
  struct Level {
    double gathered = 1.0, over_links = 0.0;
    double missed = 0.0;  ///< flux that was sent and that x, as it was, does not have; with its bounces, if it stays so
  };
  using Levels = std::vector<std::array<Level, 3>>;
  enum class Stage { kDone, kTracing, kSolving };
  /// Of a part of the scene: what shines there, all together and what of it arrives somewhere, with the sky's, and what
  /// is taken of light that is 1 all over. Times area.
  struct SourceSum {
    Light shining{}, arrives{}, takes{};
    double area = 0.0;
  };
  void takeLight(std::size_t half);
  void joinParts();
  template <typename Arriving>
  void passOn(std::size_t half, const Arriving& arriving);
  void takeSources(std::size_t half, std::span<SourceSum> sums) noexcept;
  [[nodiscard]] std::vector<bool> litSides(std::size_t half) const;
  [[nodiscard]] bool endsInLight(std::size_t half, std::uint32_t end, const std::vector<bool>& lit) const;
  [[nodiscard]] RayGmres::Vectors evenLight(std::size_t half, const std::vector<SourceSum>& sums) const;
  void average(std::size_t half);
  void followSteps(std::size_t half, const std::vector<Light>* source);
  void followMirrors(std::size_t half, const std::vector<Light>* source);
  [[nodiscard]] Light32 tintOf(const LeafSights::Step& step) const;
  [[nodiscard]] Light32 shotAt(std::size_t half, std::uint32_t end) const;
  /// Ways that light takes by mirrors and panes: those that no mirror reflects, too, or not.
  enum class Ways { kAll, kMirrors };
  template <typename Met>
  [[nodiscard]] std::vector<Light32> reflectedOf(std::size_t half, Ways ways, const Met& met) const;
  struct Reflected {
    std::vector<Light32> all, of_mirrors;  ///< the latter empty where there are no panes
    [[nodiscard]] const std::vector<Light32>& byMirrors() const { return of_mirrors.empty() ? all : of_mirrors; }
  };
  template <typename Met>
  [[nodiscard]] Reflected reflectedBoth(std::size_t half, const Met& met) const;
  [[nodiscard]] Light32 throughPanes(std::size_t half, std::uint32_t end) const;
  void takeMirrors(std::size_t half);
  [[nodiscard]] bool takesLight(std::size_t half, std::uint32_t end) const;
  [[nodiscard]] bool isImaged(const LeafSights::Step& step) const;
  [[nodiscard]] Light32 imagedIn(std::size_t half, const LeafSights::Step& step) const;
  [[nodiscard]] Light32 arrivesAsImage(std::size_t half, std::uint32_t lamp, std::uint32_t end) const;
  [[nodiscard]] Light32 arrivesOtherwise(std::size_t half, std::uint32_t lamp, std::uint32_t end,
                                         const Reflected& arrives) const;
  [[nodiscard]] Light32 imagedAt(std::size_t half, std::uint32_t end) const;
  void takeImages();
  [[nodiscard]] double noiseOf(std::span<const glm::vec3> a, std::span<const glm::vec3> b) const;
  void spreadImages();
  void tellImages();
  [[nodiscard]] double partThroughPanes(std::size_t half, std::size_t value) const {
    return halves_[half].through_panes.empty() ? 0.0 : static_cast<double>(halves_[half].through_panes[value]);
  }
  [[nodiscard]] double atGlass(std::size_t half, std::size_t value) const {
    return halves_[half].at_glass.empty() ? 0.0 : static_cast<double>(halves_[half].at_glass[value]);
  }
  [[nodiscard]] double taken(std::size_t value) const {
    return light_.mirrors && light_.mirrors->isGlass(static_cast<std::uint32_t>(value)) ? 0.0 : 1.0;
  }
  void takeMirroredSky(std::size_t half);
  void meanOfShot();
  void weighMirrors();
  [[nodiscard]] Light mirroredAt(std::size_t half, std::size_t value) const {
    if (halves_[half].mirrored.empty()) return {};
    const auto& mirrored = halves_[half].mirrored[value];
    return {mirrored[0], mirrored[1], mirrored[2], 0.0};
  }
  [[nodiscard]] Light inMirrorsAt(std::size_t half, std::size_t value) const {
    if (halves_[half].in_mirrors.empty()) return {};
    const auto& light = halves_[half].in_mirrors[value];
    return {light[0], light[1], light[2], 0.0};
  }
  [[nodiscard]] Light shotOf(std::size_t half, std::size_t value) const {
    if (halves_[half].shot.empty()) return {};
    const auto& shot = halves_[half].shot[value];
    return {shot[0], shot[1], shot[2], 0.0};
  }
  void sweep(std::size_t half, RayGmres::Vectors& x, bool affine);
  void take(std::size_t half, const Levels& levels) noexcept;
  void takeSolutions();
  void weighRays();
  void weighRays(std::size_t half, UnionFind& parts);
  void joinSteps(std::size_t half, std::uint32_t end, UnionFind& parts) const;
  [[nodiscard]] Light solved(std::size_t half, std::size_t value) const;
  /// What the level of a part of the scene follows from.
  struct LevelSum {
    Light left{}, kept{}, size{}, all{}, stays{};
    Light least{};  ///< x, where it is below 0, of what came over links there
    double area = 0.0;
    void add(const LevelSum& other);
  };
  [[nodiscard]] Levels levels(std::size_t half);
  void addLevels(std::size_t half, std::span<LevelSum> sums) const noexcept;
  template <typename Visit>
  void visitParted(std::size_t half, std::span<const std::uint32_t> leaves, const Visit& visit) const;
  void weighPartedLoss(std::size_t half);
  [[nodiscard]] Light sentFrom(std::size_t half, std::uint32_t end) const;
  [[nodiscard]] double passedAt(std::size_t half, std::uint32_t value, std::size_t channel) const {
    const auto& passed = halves_[half].passed;
    return passed.empty() ? 0.0 : static_cast<double>(passed[value][channel]);
  }
  /// It is parted, and some of its rays are lost.
  [[nodiscard]] bool losesApart(std::size_t half, std::uint32_t value) const {
    return has_parted_ && sights_.isParted(value) && lostOf(half, value).all() > 0.0;
  }
  void weighMissed(const std::array<Levels, 2>& levels);
  void weighNoise();
  void weighLost();
  void weighShading();
  /// Of a side, by channel and leaf: the mean of what rays see; what arrives, as a vector of which the product with a
  /// normal is irradiance; and what of that product is not there, since it is below the horizon of the shading normal.
  struct ShadedLight {
    static constexpr std::size_t kParts = 5, kBelow = 4;
    std::array<std::array<std::vector<float>, 3>, kParts> part;
  };
  void addShadedRays(std::size_t half, std::uint32_t value, std::uint32_t number, ShadedRays& rays) const;
  void sumShaded(std::size_t half, std::uint32_t value, std::uint32_t leaf, const ShadedRays::Leaf& of,
                 std::span<const ShadedRays::Weights> weights, ShadedLight& light) const;
  void weighShading(std::size_t half, std::size_t number);
  void keepShadedRays();
  /// There will be others.
  void forgetShadedRays();
  void weighDoubt();
  [[nodiscard]] glm::dvec3 doubtOf(std::size_t half, std::uint32_t end) const;
  [[nodiscard]] std::size_t leastBytes() const { return leastBytes(sights_.leafCount(), has_mirrors_); }
  [[nodiscard]] std::size_t stepBytes() const;
  void limitSights();
  [[nodiscard]] glm::dvec3 cutOffAt(std::uint32_t value) const;
  [[nodiscard]] glm::dvec3 changeAcross(std::uint32_t value) const;
  /// By block of leaves: how many rays they have, how many have some, and the one with most; how many times as many
  /// are asked for.
  struct BlockRays {
    std::uint32_t rays = 0, leaves = 0, most = 0, times = 1;
  };
  [[nodiscard]] std::vector<BlockRays> blockRays() const;
  /// For more rays.
  struct Room {
    std::size_t bytes, ray_bytes;
  };
  [[nodiscard]] bool takeDouble(BlockRays& block, Room& taken);
  void refineBlotches(const BesideLight& beside, std::vector<BlockRays>& blocks, Room& taken);
  void finish();

  LeafSights sights_;
  MirroredLamps mirrored_lamps_;
  std::size_t most_bytes_;
  bool has_gathered_ = false, lacks_memory_ = false, has_mirrors_ = false;
  const std::vector<Side>& sides_;
  std::vector<float> own_area_;
  std::span<const float> area_;  ///< by leaf value, unit box squared
  [[nodiscard]] double areaOf(std::size_t value) const { return static_cast<double>(area_[value]); }
  // Of the rays that there are:
  /// As parts of all of them.
  struct Lost {
    float above = 0.0F, below = 0.0F, absorbed = 0.0F, doubtful = 0.0F;
    [[nodiscard]] double escaped() const { return static_cast<double>(above) + static_cast<double>(below); }
    [[nodiscard]] double all() const { return escaped() + static_cast<double>(absorbed); }
  };
  [[nodiscard]] Lost lostOf(std::size_t half, std::size_t value) const {
    const auto count = sights_.counts()[value];
    if (count == 0 || !lost_[half].hasAny(value)) return {};
    const auto part = [one = 1.0F / static_cast<float>(count)](std::uint16_t rays) { return rays * one; };
    const auto rays = lost_[half].at(value);
    return {part(rays.above), part(rays.below), part(rays.absorbed), part(rays.doubtful)};
  }
  [[nodiscard]] Light skyAt(std::size_t half, std::size_t value, const Lost& lost) const;
  void takeSky(std::size_t half);
  [[nodiscard]] const Light& lossOf(std::size_t half, std::uint32_t value) const;
  bool is_weighed_ = false;  ///< the following are known
  std::optional<LeafSmoother> smoother_;
  bool has_parted_ = false;                        ///< leaves, as of LeafSights
  std::array<std::vector<Light>, 2> parted_loss_;  ///< by half and part: see there
  struct Arrival {
    std::uint32_t value, end;
  };
  /// Parted leaves that lose some light, and rays that end on them.
  struct Parted {
    std::vector<std::uint32_t> leaves;
    std::vector<Arrival> arrivals;
  };
  /// Of a part of the scene: what such leaves send, what they would lose if they shone evenly, and what arrives from
  /// them.
  struct PartedFlux {
    Light sent{}, even{}, arrives{};
  };
  void addArrival(std::size_t half, const Arrival& ray, std::span<PartedFlux> fluxes) const;
  /// By half; none: not known, or these are many.
  std::array<std::optional<Parted>, 2> parted_;
  std::array<LostRays, 2> lost_;          ///< by half; empty: none
  std::vector<std::uint32_t> part_;       ///< by side: which part of the scene, whose number is that of a side
  std::vector<std::uint32_t> seen_part_;  ///< likewise, if nothing were translucent
  LeftLight light_;
  Stage stage_ = Stage::kDone;
  std::array<Half, 2> halves_;
  std::array<LeafSmoother::Light, 2> solved_;  ///< by half: x, smoothed; while taking it
  std::array<std::vector<glm::vec3>, 2> gathered_;
  const LeafShading* shading_ = nullptr;
  std::array<std::vector<glm::vec3>, 2> shaded_part_;
  /// Of the rays that there are light was weighed for shading normals; what they count for that is kept.
  bool has_shaded_ = false, keeps_shaded_rays_ = false;
  std::array<std::vector<ShadedRays>, 2> shaded_rays_;  ///< by half, by side of LeafShading::sides()
  double noise_ = 0.0, smoothed_ = 0.0, bias_ = 0.0, doubt_ = 0.0, unsolved_ = 0.0, unsolved_square_ = 0.0;
  std::array<double, 2> image_noise_{};  ///< of images, and of caustics
  std::vector<double> block_noise_;      ///< parts of it but for smoothed_, what smoothing took, by kBlock leaves
  std::vector<double> block_light_;      ///< likewise, of all irradiance
  std::vector<double> side_noise_, side_light_;  ///< likewise, by side
  std::vector<float> leaf_bias_;
  std::array<double, 3> escaped_{}, absorbed_{}, from_sky_{}, mirrored_flux_{}, spread_{}, imaged_flux_{};
};

}  // namespace radiosity::solver
