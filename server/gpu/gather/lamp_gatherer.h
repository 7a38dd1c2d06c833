// Light of lamps with a size or a web at every leaf: what all of the lamp brings to places on the leaf, in closed form
// where there is one, times the part of it that these see. Each place looks at a point of its own, by a ray: an image
// from the lamp would show what one of its points sees. One thread.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "server/gpu/gather/flux_sink.h"
#include "server/gpu/gather/light_delivery.h"
#include "server/gpu/gather/receivers.h"
#include "server/solver/transport/lamp_rays.h"

namespace radiosity::gpu {

class LampGatherer {
 public:
  LampGatherer() = default;
  explicit LampGatherer(std::shared_ptr<const Receivers> receivers)
      : receivers_(std::move(receivers)), box_(solver::sceneBox(receivers_->patches())) {}

  /// `webs`, the tables of lamps, of the whole batch. Cost: up to kMaxReceiverPoints rays a receiver, and some thousand
  /// that leave the lamp.
  void gather(const solver::LampShot& shot, std::span<const float> webs, double flux_scale, const FluxSink& sink,
              solver::TransportCounters& counters);

 private:
  /// A way to a point of the lamp.
  struct Look {
    std::size_t receiver = 0;
    float whole = 0.0F, brings = 0.0F;
  };
  class Ways;
  void lookFrom(const solver::LampShot& shot, const solver::Lamp& lamp, const Receivers::Group& group, Ways& ways);
  [[nodiscard]] LostShare loseByRays(const solver::LampShot& shot, const solver::Lamp& lamp);
  [[nodiscard]] LostShare loseFromFar(const solver::LampShot& shot, const solver::Lamp& lamp, std::uint64_t key) const;

  std::shared_ptr<const Receivers> receivers_;
  std::array<glm::vec3, 2> box_{};
  solver::KnownWebs webs_;
  std::vector<solver::LampLooks> looks_;  ///< by receiver
  std::vector<float> irradiance_;         ///< by receiver: for an intensity of 1
};

}  // namespace radiosity::gpu
