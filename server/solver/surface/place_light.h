// How much light arrives at single places of surfaces, whatever the texels there have of it: from lamps, which are
// looked at from the place, and from all else by rays, which bring what the leaves have that they end on. Two
// independent estimates, neither of which knows of texels. Immutable; any thread.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "server/scene/shading/shading_normals.h"
#include "server/scene/values/patch_scene.h"
#include "server/solver/lamps/lamp_images.h"
#include "server/solver/lamps/light_tree.h"
#include "server/solver/lamps/punctual_lights.h"
#include "server/solver/lamps/sky_sources.h"
#include "server/solver/patches/lights.h"
#include "server/solver/patches/passing.h"
#include "server/solver/rays/leaf_rays.h"
#include "server/solver/rays/specular_leaves.h"
#include "server/solver/surface/bright_leaves.h"
#include "server/solver/surface/lamp_glints.h"
#include "server/solver/surface/tinted_rays.h"

namespace radiosity::solver {

/// A solved scene. What it refers to is to outlive whoever has it, but for `materials`, `sources` and `irradiance`.
struct SolvedScene {
  const scene::PatchScene& patches;
  std::shared_ptr<const LeafRays> rays;  ///< of it; null: they are made
  std::shared_ptr<const scene::ShadingNormals> normals;
  const scene::PatchMaterials& materials;
  const LightSources& sources;
  std::span<const glm::vec3> irradiance;  ///< lux, by node of level 0
  /// What two independent halves of the solve differ by, likewise; empty: not known. Need not outlive it either.
  std::span<const glm::vec3> difference = {};
};

class PlaceLight {
 public:
  /// Samples of each of the two estimates.
  static constexpr std::uint32_t kRays = 128;
  /// Points of a lamp, at most, that look at a place.
  static constexpr std::uint32_t kMostLooks = 32;

  /// O(n log n) in triangles where rays are to be made, else in leaves. Throws std::bad_alloc.
  explicit PlaceLight(const SolvedScene& solved);

  /// Where on a leaf; the normal of `place` is the geometric one of the lit side.
  struct Spot {
    LeafRays::Place place;
    glm::dvec3 shading{0.0};  ///< normal that light is told for, on the same side
    glm::vec2 texel{0.0F};    ///< of its chart
  };
  /// At (u, v) in [0, 1)^2 of a leaf that has area, evenly.
  [[nodiscard]] Spot spotOn(std::uint32_t value, const glm::vec2& at) const;
  /// Of a place that need lie on no surface.
  [[nodiscard]] static Spot spotAt(const glm::dvec3& position, const glm::dvec3& normal) {
    return {{position, normal}, normal, {}};
  }
  /// Irradiance, lux. The same key gives the same bits. Cost: kRays rays, half as many again where some leaves are far
  /// brighter than others, and of each lamp some tens more where it is seen in part; of more than kEachLamp of them 64
  /// in all.
  [[nodiscard]] glm::dvec3 arriving(const Spot& spot, std::uint64_t key) const;

  /// The same by so many rays, in parts, and by kMostLooks looks at every lamp, so that several tell the variance even
  /// at the edges of shadows. `off` is what the reflected part of a solve with the halves of
  /// SolvedScene::difference is off by, one standard deviation of either sign; 0 where that is not known.
  struct Arriving {
    glm::dvec3 direct{0.0}, reflected{0.0}, off{0.0};
  };
  [[nodiscard]] Arriving arriving(const Spot& spot, std::uint64_t key, std::uint32_t rays) const;
  /// What such a place takes beside so many rays, at most: looks at lamps and at bright leaves.
  [[nodiscard]] std::uint64_t looksAPoint(std::uint32_t rays) const;
  /// Other irradiance and difference of the same scene, by node of level 0.
  void setIrradiance(std::span<const glm::vec3> irradiance, std::span<const glm::vec3> difference);
  /// Of the sky, lm/m^2: pi times the radiance in the middle of a cell.
  [[nodiscard]] glm::dvec3 skyAt(std::uint32_t cell) const { return sky_->at(cell); }
  /// By leaf value.
  [[nodiscard]] const std::vector<glm::vec3>& reflectance() const { return reflectance_; }
  [[nodiscard]] const std::vector<PassingLeaf>& passing() const { return passing_; }
  /// lm/m^2, by leaf value, of all but lamps(); and what that is off by, one standard deviation of either sign: empty
  /// where it is not known.
  [[nodiscard]] const std::vector<glm::vec3>& radiosity() const { return radiosity_; }
  [[nodiscard]] const std::vector<glm::vec3>& off() const { return off_; }
  /// What lamps() shine with, likewise; empty: there are no mirrors that could show them.
  [[nodiscard]] const std::vector<glm::vec3>& lampEmission() const { return lamp_emission_; }
  /// Surfaces and sources that places look at; none of them is dark.
  [[nodiscard]] std::span<const LightPolygon> lamps() const {
    return many_ ? std::span<const LightPolygon>(many_->lights()) : std::span<const LightPolygon>(lamps_);
  }
  [[nodiscard]] const std::vector<PunctualLights::Source>& sources() const { return sources_; }
  [[nodiscard]] const SpecularLeaves* mirrors() const { return mirrors_.get(); }
  [[nodiscard]] const TintedRays& tinted() const { return tinted_; }

  [[nodiscard]] const std::vector<Side>& sides() const { return *sides_; }
  [[nodiscard]] const LeafRays& rays() const { return *rays_; }

 private:
  /// How many points of a lamp look: all, or fewer where the first agree.
  enum class Looks { kAll, kFewer };
  struct Gathered {
    glm::dvec3 light{0.0}, off{0.0};
  };
  [[nodiscard]] Gathered reflected(const Spot& spot, std::uint64_t key, std::uint32_t rays) const;
  [[nodiscard]] glm::dvec3 fromBright(const Spot& spot, std::uint64_t key, const SampleCounts& counts) const;
  /// What a ray met, which travelled along `direction`; `steps`: it goes on from leaves that something cuts so often.
  struct Met {
    std::uint32_t value;
    LeafRays::Place end;
    glm::dvec3 direction;
    std::uint64_t key;
    std::size_t steps;
  };
  [[nodiscard]] glm::dvec3 alongMirrors(const Met& met) const;
  void takeMirrors(const scene::PatchMaterials& materials);
  /// Lamps of one kind in flat mirrors, and what they shine with.
  struct Images {
    std::shared_ptr<const LampImages> images;  ///< null: none
    std::vector<glm::vec3> light;
    [[nodiscard]] bool isIn(std::uint32_t value) const { return images && images->isIn(value); }
  };
  [[nodiscard]] glm::dvec3 fromImages(const Images& images, const Spot& spot, std::uint64_t key, Looks looks) const;
  void spreadSources();
  [[nodiscard]] glm::dvec3 fromSources(const Spot& spot, std::uint64_t key) const;
  [[nodiscard]] glm::dvec3 reflectedBy(const Spot& spot, std::uint64_t key, std::size_t steps) const;
  [[nodiscard]] glm::dvec3 leaving(std::uint32_t value, const LeafRays::Place& end, std::uint64_t key,
                                   std::size_t steps) const;
  [[nodiscard]] glm::dvec3 direct(const Spot& spot, std::uint64_t key, Looks looks) const;
  [[nodiscard]] glm::dvec3 fromLampOfSize(const Lamp& lamp, const Spot& spot, std::uint64_t key) const;
  [[nodiscard]] glm::dvec3 fromLamp(const LightPolygon& lamp, const Spot& spot, std::uint64_t key, Looks looks) const;
  [[nodiscard]] glm::dvec3 fromSomeLamps(const Spot& spot, std::uint64_t key) const;
  /// Of points of a lamp: the part that is seen, by what each brings, and the colour of what comes from there.
  struct Seen {
    double part = 0.0, all = 0.0;
    glm::dvec3 light{0.0};  ///< of `all`, by channel
    [[nodiscard]] glm::dvec3 mean() const { return all > 0.0 ? light / all : glm::dvec3(0.0); }
    /// Nothing is hidden, or all is.
    [[nodiscard]] bool agree() const { return part <= 0.0 || part >= all; }
  };
  void look(const LightPolygon& lamp, const Spot& spot, std::uint64_t key, std::uint32_t first, std::uint32_t end,
            Seen& seen) const;
  const scene::PatchScene& patches_;
  std::shared_ptr<std::vector<Side>> sides_;  ///< rays made here refer to them, wherever this is moved to
  std::shared_ptr<const LeafRays> rays_;
  TintedRays tinted_;  ///< these
  std::shared_ptr<const scene::ShadingNormals> normals_;
  std::vector<LightPolygon> lamps_;  ///< each by itself; empty: there are too many, or none
  std::optional<LightTree> many_;
  std::vector<PunctualLights::Source> sources_;
  std::optional<SkyLight> sky_;
  /// By leaf value, lm/m^2: what shines and is no lamp of these, and what is reflected of what arrives.
  std::vector<glm::vec3> emission_, reflectance_, radiosity_;
  std::vector<PassingLeaf> passing_;
  std::vector<glm::vec3> passed_;       ///< of radiosity_, what came through translucent leaves; empty: nothing does
  std::vector<glm::vec3> off_;          ///< what radiosity_ is off by; empty: not known
  std::optional<BrightLeaves> bright_;  ///< by radiosity_; nothing: rays meet what there is
  std::shared_ptr<const SpecularLeaves> mirrors_;  ///< null: none
  std::vector<glm::vec3> lamp_emission_;           ///< by leaf value, of lamps; empty: no mirror shows any
  Images lamp_images_, source_images_;
  LampGlints glints_;          ///< of lamps, but for crowds
  float least_imaged_ = 0.0F;  ///< emission of lamps of the former, at least
};

}  // namespace radiosity::solver
