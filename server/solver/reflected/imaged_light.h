// What leaves get of the images of lamps in flat mirrors, kept by image, so that an edit of light asks no ray again.
// Two independent halves, by places and points of their own. Owned by LeafGather; one thread outside of the calls.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <vector>

#include "server/solver/lamps/lamp_images.h"
#include "server/solver/patches/side.h"
#include "server/solver/rays/leaf_rays.h"
#include "server/solver/reflected/leaf_shading.h"

namespace radiosity::solver {

class ImagedLight {
 public:
  /// `sides` are to outlive it. `most_bytes`: for all that it keeps; images that need more are given up.
  ImagedLight(const std::vector<Side>& sides, std::shared_ptr<const LeafRays> rays, std::uint64_t seed,
              std::size_t most_bytes)
      : sides_(sides), rays_(std::move(rays)), seed_(seed), most_bytes_(most_bytes) {}

  struct Lamps {
    std::shared_ptr<const LampImages> images;  ///< null: there are none
    std::vector<glm::vec3> light;              ///< what each shines with (LampImages::lightOf)
  };
  /// Looks at these from now on. What is known of those that were there before stays known. `shading`: normals that
  /// light is told for, too, null for none; to outlive it.
  void begin(Lamps lamps, const LeafShading* shading);
  /// From then on each leaf looks about `times` as often, a power of two, at most kMostTimes in all. False: it does so
  /// already.
  bool refine(double times);
  static constexpr std::uint32_t kMostTimes = 64;
  [[nodiscard]] std::uint32_t times() const { return times_; }
  void setTimes(std::uint32_t times) { times_ = times; }
  /// Goes on for about `seconds`, on all cores: until it is true. Where the cuts lie changes nothing. Throws
  /// std::bad_alloc.
  bool advance(double seconds);
  /// Rays that the first looks at images take that begin() would find nothing known of.
  [[nodiscard]] std::uint64_t looksFor(const Lamps& lamps) const;
  /// They took too much memory: from then on nothing is looked at.
  [[nodiscard]] bool isGivenUp() const { return is_given_up_; }
  /// More looks are asked for than were made.
  [[nodiscard]] bool isBehind() const;
  /// After that; null: there are none.
  [[nodiscard]] const LampImages* images() const { return lamps_.images.get(); }

  /// Adds what leaves get, by leaf value, or for the normals of `shading`, by their number.
  void addTo(std::size_t half, std::vector<glm::vec3>& irradiance) const;
  void addShadedTo(std::size_t half, std::vector<glm::vec3>& irradiance) const;
  [[nodiscard]] std::size_t bytes() const;

 private:
  /// What a leaf gets of an image for an emission, or intensity, of one; by half.
  struct Leaf {
    std::uint32_t value = 0;
    std::uint32_t number = scene::kNone;  ///< of its shading normal
    std::array<glm::vec3, 2> light{}, shaded{};
  };
  struct OfImage {
    std::uint64_t key = 0;
    std::uint32_t times = 0;
    bool is_whole = false;                 ///< all sides were looked at
    std::vector<std::vector<Leaf>> parts;  ///< those that get some, by the rows that were looked from together
  };
  /// Rows of a side, first to end - 1.
  struct Look {
    std::uint32_t image, side, first, end;
  };
  [[nodiscard]] bool isKnown(const OfImage& image, std::uint64_t key) const;
  [[nodiscard]] bool isKnown(std::uint64_t key) const;
  void plan(std::uint32_t image);
  [[nodiscard]] std::vector<Leaf> look(const Look& look) const;
  void askAgain(const LampImages::Image& image, Leaf& leaf) const;
  void keepSpare();
  /// Returns at how many of its places a leaf sees something of the image, of 2 `looks`.
  std::uint32_t lookFrom(const LampImages::Image& image, std::uint32_t looks, Leaf& leaf) const;
  template <typename Visit>
  void forEachLeaf(const Visit& visit) const;
  void giveUp();

  const std::vector<Side>& sides_;
  std::shared_ptr<const LeafRays> rays_;
  std::uint64_t seed_;
  std::size_t most_bytes_;
  Lamps lamps_;
  const LeafShading* shading_ = nullptr;
  std::uint32_t times_ = 1;  ///< as many looks as at first
  bool is_given_up_ = false;
  std::vector<OfImage> known_;  ///< as the images are
  std::vector<OfImage> spare_;  ///< of others, which may come back
  std::vector<Look> pending_;
  std::size_t next_ = 0;  ///< of these
};

}  // namespace radiosity::solver
