#include "server/engine/publish/stated_error.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>

namespace radiosity::engine {
namespace {

/// In a name that is told with a measurement.
constexpr std::size_t kMostName = 100;

/// What smoothing has in common in both halves, as part of all light.
double commonPart(const LitScene& lit, const std::vector<glm::vec3>& light) {
  const auto common = lit.solver().commonErrorSquared();
  const auto& area = lit.patches().node_area;
  double squares = 0.0, all = 0.0;
  for (std::size_t n = 0; n < common.size(); ++n) {
    squares += static_cast<double>(area[n] * (common[n].x + common[n].y + common[n].z));
    all += static_cast<double>(area[n] * glm::dot(light[n], light[n]));
  }
  return all > 0.0 ? std::sqrt(squares / all) : 0.0;
}

}  // namespace

double systematicPart(const LitScene& lit, const std::vector<glm::vec3>& light) {
  const auto& solver = lit.solver();
  const bool is_known = lit.settings().method != Method::kPaper && !lit.isStale() && lit.showsOwnLight() &&
                        !solver.isRepairing() && !solver.isUnsettled() && solver.rounds() > 0;
  if (!is_known) return 1.0;
  return std::min(1.0, std::hypot(solver.error().residual, solver.error().variation, commonPart(lit, light)));
}

std::string shortName(std::string name) {
  if (name.size() <= kMostName) return name;
  std::size_t end = kMostName;
  while (end > 0 && (static_cast<unsigned char>(name[end]) & 0xC0U) == 0x80U) --end;
  name.resize(end);
  return name;
}

}  // namespace radiosity::engine
