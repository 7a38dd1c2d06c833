#include "server/solver/transport/lamp_rays.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace radiosity::solver {

std::shared_ptr<const scene::WebDirections> KnownWebs::of(std::span<const float> table) {
  auto found = std::ranges::find_if(known_, [&](const auto& known) { return std::ranges::equal(known->table, table); });
  if (found == known_.end()) {
    if (known_.size() == kMost) known_.pop_front();
    found = known_.insert(known_.end(), std::make_shared<const Known>(table));
  }
  return {*found, &(*found)->directions};
}

LampRays::LampRays(const Lamp& lamp, KnownWebs& webs) : lamp_(lamp) {
  if (lamp.shape.kind == LampShape::Kind::kWeb) web_ = webs.of(lamp.web);
}

LampRay LampRays::operator()(const std::array<double, 4>& at) const {
  if (!web_) return lampRay(lamp_, at);
  const auto drawn = web_->at({at[0], at[1]});
  const glm::dvec3 axis(lamp_.shape.axis), across(lamp_.shape.across);
  const auto aside = std::cos(drawn.azimuth_rad) * across + std::sin(drawn.azimuth_rad) * glm::cross(across, axis);
  const auto direction = std::cos(drawn.polar_rad) * axis + std::sin(drawn.polar_rad) * aside;
  return {lamp_.shape.centre, glm::vec3(direction), drawn.weight};
}

}  // namespace radiosity::solver
