#include "server/solver/repair/repair.h"

#include <algorithm>

namespace radiosity::solver {
namespace {

/// So many shots of a light look first: where leaves can look for themselves, or not.
constexpr std::uint32_t kFirstOfFew = 1, kFirst = 2;

}  // namespace

bool mayLookFromLeaves(const LinkParts& parts) { return parts.patches.opacity.empty(); }

/// The first have the coarse images (PlannerSettings::lightResolution): until the others look, what they blur is
/// blurred beside leaves of which most samples did not. When nothing else is to be done one looks after the other, so
/// that no edit waits for all of them.
ShotRange shotsOfLight(const LinkParts& parts, const RepairRules& rules, const Repair& repair) {
  const auto all = lightShots(repair.samples), first = lightShots(repair.looked);
  // The first shot has the rest of a division, which may be two points.
  const auto few = repair.samples % kLightPoints == 0 ? kFirstOfFew : kFirstOfFew + 1;
  const auto next = repair.first_shots > 0 ? repair.first_shots : mayLookFromLeaves(parts) ? few : kFirst;
  if (repair.whole || !rules.lights_may_be_rough) return {first, all};
  if (rules.is_idle) return {first, std::min(all, first + 1)};
  return {first, next <= first ? all : std::min(all, next)};
}

std::uint32_t shotsOf(const LinkParts& parts, const RepairRules& rules, const Repair& repair) {
  if (!parts.system.shooters()[repair.shooter].isLight()) return repair.samples;
  const auto [first, end] = shotsOfLight(parts, rules, repair);
  return end - first;
}

void addSamples(const LinkParts& parts, const RepairRules& rules, const Repair& repair, ShotBatch& batch) {
  const auto& shooter = parts.system.shooters()[repair.shooter];
  if (!shooter.isLight()) {
    for (std::uint32_t i = 0; i < repair.samples; ++i)
      parts.shots.add(shooter.place, repair.half, i, shooter.resolution, batch);
    return;
  }
  const std::uint32_t few = 1 + (repair.samples - 1) % kLightPoints;  // the first shot has the rest of a division
  const auto [first, end] = shotsOfLight(parts, rules, repair);
  for (auto i = first; i < end; ++i)
    parts.shots.add(parts.lights[shooter.light], repair.half, i, i == 0 ? few : kLightPoints,
                    parts.settings.planner.lightResolution(i), batch);
}

}  // namespace radiosity::solver
