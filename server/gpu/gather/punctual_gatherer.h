// Light without extent (point, spot, directional, sky) at every leaf: exact irradiance at receiving points times
// visibility, which item buffers or rays decide. One thread.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "server/gpu/draw/image_source.h"
#include "server/gpu/gather/flux_sink.h"
#include "server/gpu/gather/light_delivery.h"
#include "server/gpu/gather/receivers.h"

namespace radiosity::gpu {

class PunctualGatherer {
 public:
  PunctualGatherer() = default;
  explicit PunctualGatherer(std::shared_ptr<const Receivers> receivers)
      : receivers_(std::move(receivers)), box_(solver::sceneBox(receivers_->patches())) {}

  void gather(const solver::PointShot& shot, double flux_scale, ImageSource& source, const FluxSink& sink,
              solver::TransportCounters& counters);
  /// `views` of the whole batch.
  void gather(const solver::ParallelShot& shot, std::span<const solver::ParallelView> views, double flux_scale,
              ImageSource& source, const FluxSink& sink, solver::TransportCounters& counters);

  /// The same by rays.
  void gather(const solver::PointShot& shot, double flux_scale, const FluxSink& sink,
              solver::TransportCounters& counters);
  void gather(const solver::ParallelShot& shot, std::span<const solver::ParallelView> views, double flux_scale,
              const FluxSink& sink, solver::TransportCounters& counters);

 private:
  /// What a light brings to a place, should nothing hide it, and the way to the light.
  struct Arrival {
    std::size_t receiver;
    float value;
    Receivers::Ray ray;
    std::uint32_t care;  ///< Receivers::careOf
  };
  template <typename Take>
  void forEachArrival(const solver::PointShot& shot, const Take& take) const;
  template <typename Take>
  void forEachArrival(const solver::ParallelShot& shot, const solver::ParallelView& view, std::size_t view_index,
                      const Take& take) const;
  template <typename Take>
  void arriveAtGroup(const solver::PointShot& shot, const Receivers::Group& group, const Take& take) const;
  template <typename Each>
  void askRays(std::uint64_t look, const Each& each);
  [[nodiscard]] LostShare weighLost(const solver::PointShot& shot, std::span<const std::uint32_t> items) const;
  [[nodiscard]] LostShare weighLost(const solver::ParallelView& view, double pixel_area,
                                    std::span<const std::uint32_t> items) const;
  [[nodiscard]] LostShare loseByRays(const solver::PointShot& shot) const;
  [[nodiscard]] LostShare loseByRays(const solver::ParallelView& view, std::uint32_t count) const;
  [[nodiscard]] static float skyScale(std::span<const glm::vec3> normals, const glm::vec3& axis,
                                      std::span<const solver::ParallelView> sky);
  void scaleToSky(const solver::ParallelShot& shot, std::span<const solver::ParallelView> sky);

  std::shared_ptr<const Receivers> receivers_;
  std::array<glm::vec3, 2> box_{};
  std::vector<float> sum_;  ///< by receiver: irradiance for an intensity of 1
};

}  // namespace radiosity::gpu
