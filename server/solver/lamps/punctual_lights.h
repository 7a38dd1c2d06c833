// Lights that are no surfaces (KHR_lights_punctual, those with a size or a web, the sky) as shots of gathered direct
// light.
//
// Every round plays one sequence of shots for each source: the same sequence numbers give the same shots, so an edit of
// a source replays what was delivered, with the difference of intensities, and cancels it to the last bit. Owned by the
// Solver; one thread.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <vector>

#include "server/scene/values/scene.h"
#include "server/solver/transport/lamp_shape.h"
#include "server/solver/transport/transport.h"

namespace radiosity::solver {

/// The lights of a scene that are no surfaces.
struct LightSources {
  std::vector<scene::PunctualLight> lights;  ///< metres, candela and lux
  scene::Sky sky;

  bool operator==(const LightSources&) const = default;
};

/// Flux of all of them, all channels, lux unit^2.
[[nodiscard]] double totalFlux(const scene::PatchScene& patches, const LightSources& sources);

struct PunctualSettings {
  std::uint64_t seed = 1;
  std::uint32_t point_resolution = 256;     ///< N of a point light's hemicubes, at least: more where leaves are finer
  std::uint32_t parallel_resolution = 512;  ///< of a directional light's images, at least
  std::uint32_t sky_resolution = 256;
  std::uint32_t images = 2;           ///< of a point or directional light, each round and half
  std::uint32_t sky_directions = 64;  ///< of either hemisphere of the sky, each round and half
  std::uint32_t views_a_shot = 8;     ///< sky directions carried together
  std::uint32_t images_a_slice = 32;  ///< so many images make one batch
  bool rays_see_sky = true;           ///< pictures of the sky are lamps only where they are bright; false: all of them
};

class PunctualLights {
 public:
  /// One light, one hemisphere of the sky, or a picture of it.
  struct Source {
    enum class Kind { kPoint, kSpot, kDirectional, kSky, kLamp } kind = Kind::kPoint;
    glm::vec3 position{0.0F};   ///< unit box
    glm::vec3 direction{0.0F};  ///< axis of a spot; towards the light, or to the middle of the hemisphere
    float cone_scale = 0.0F, cone_offset = 1.0F, range = 0.0F;
    glm::dvec3 intensity{0.0};        ///< lux unit^2 / sr; lux; of the sky radiance, nits
    double flux_per_intensity = 0.0;  ///< unit^2 sr; unit^2
    std::uint64_t key = 0;            ///< of its sample sequences
    glm::dvec3 delivered{0.0};        ///< intensity of every sequence played
    std::uint32_t sequences = 0;      ///< played so far: 0 .. sequences - 1
    LampShape shape;                  ///< of a kLamp
    /// Of a kLamp that has one: LightWeb::table, or that of a sky. Of a kSky that is a picture: its radiance by cell
    /// (SkyCells), three numbers each, for an intensity of one.
    std::shared_ptr<const std::vector<float>> web;
    std::uint64_t web_key = 0;

    /// All but intensity: what sample sequences depend on.
    [[nodiscard]] bool sameShape(const Source& other) const;
    [[nodiscard]] std::uint64_t shapeKey() const;
    /// Of a kLamp. Where the web is not known any more (a dark lamp of before a restart) it is black.
    [[nodiscard]] Lamp lamp() const;
    [[nodiscard]] bool isPicture() const { return kind == Kind::kSky && web != nullptr; }

    template <typename Archive, typename Self>
    static void visit(Archive& archive, Self& self) {
      archive(self.kind, self.position, self.direction, self.cone_scale, self.cone_offset, self.range, self.intensity,
              self.flux_per_intensity, self.key, self.delivered, self.sequences, self.shape, self.web, self.web_key);
    }
  };

  PunctualLights(const scene::PatchScene& patches, const LightSources& sources, PunctualSettings settings);

  /// Other sources: those with the same place and shape keep what they delivered; what others delivered is taken back.
  void setSources(const scene::PatchScene& patches, const LightSources& sources);

  /// Shots that bring what was delivered to `rounds` times what the sources give, in slices of moderate size; adds them
  /// to the batch. The sources count as delivered as soon as a round is planned, by the first call.
  void addSlice(std::uint32_t rounds, ShotBatch& batch);
  [[nodiscard]] bool hasSlice(std::uint32_t rounds) const { return next_ < pending_.size() || owed(rounds) > 0.0; }

  /// Whether rays of reflected light see the sky.
  void setRaysSeeSky(bool see) { settings_.rays_see_sky = see; }

  /// Lights in one place are one source; dark ones are left out.
  [[nodiscard]] std::vector<Source> makeSources(const scene::PatchScene& patches, const LightSources& sources) const;
  /// One sequence of shots of a source with intensity one, for one half.
  void addSample(const Source& source, std::uint32_t sequence, std::uint32_t half, ShotBatch& batch) const;

  /// Flux of all sources, per channel, lux unit^2: 4 pi I of a point, the cone's integral of a spot, what enters the
  /// scene's box from infinity.
  [[nodiscard]] std::array<double, 3> flux() const;
  /// Flux not yet carried, all channels and rounds, in absolute value.
  [[nodiscard]] double owed(std::uint32_t rounds) const;

  /// What was played, and what is still to be.
  template <typename Archive, typename Self>
  static void visit(Archive& archive, Self& self) {
    archive(self.sources_, self.pending_, self.next_);
  }

 private:
  [[nodiscard]] Source makeLight(const scene::PatchScene& patches, const scene::PunctualLight& light) const;
  /// With a size or a web.
  [[nodiscard]] Source makeLamp(const scene::PatchScene& patches, const scene::PunctualLight& light,
                                const Source& spot) const;
  [[nodiscard]] Source makeDirectional(const glm::dvec3& irradiance, const glm::dvec3& towards) const;
  [[nodiscard]] Source makeSky(const glm::vec3& radiance, float up) const;
  [[nodiscard]] Source makeSun(const glm::dvec3& illuminance, const glm::dvec3& towards, double radius_rad) const;
  /// What a sequence of one source delivers to one half.
  struct Task {
    Source source;
    std::uint32_t sequence = 0, half = 0;
    glm::dvec3 intensity{0.0};

    template <typename Archive, typename Self>
    static void visit(Archive& archive, Self& self) {
      archive(self.source, self.sequence, self.half, self.intensity);
    }
  };
  void plan(std::uint32_t rounds);
  void addTasks(const Source& source, std::uint32_t sequence, const glm::dvec3& intensity);
  void addTask(const Task& task, ShotBatch& batch) const;
  void addPoint(const Task& task, ShotBatch& batch) const;
  void addLamp(const Task& task, ShotBatch& batch) const;
  void addDirectional(const Task& task, ShotBatch& batch) const;
  void addSky(const Task& task, ShotBatch& batch) const;

  PunctualSettings settings_;
  std::array<glm::vec3, 2> box_{};
  std::vector<Source> sources_;
  std::vector<Task> pending_;
  std::size_t next_ = 0;  ///< of pending_, not yet carried
};

}  // namespace radiosity::solver
