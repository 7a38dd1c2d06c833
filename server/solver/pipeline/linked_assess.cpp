// What LinkedSolver says of itself: its error, the balance of energy, how much there is still to shoot, counters.
#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <new>
#include <optional>
#include <system_error>
#include <utility>

#include "common/parallel.h"
#include "server/solver/pipeline/linked_solver.h"

namespace radiosity::solver {
namespace {

/// So many, some tenths of a second of them, are traced for somebody who wants to know the light.
constexpr std::uint64_t kRaysAtOnce = 2'000'000;
/// What the last steps and sweep of solving tell of its error may be several times too small where light passes from
/// one bright room to the next: no less than this part of what the residual would have it be at worst.
constexpr double kLeastUnsolved = 0.125;
/// Largest mean reflectance that is told from one.
constexpr double kMostKept = 0.99999;

}  // namespace

void LinkedSolver::assess() {
  if (isRepairing()) return;  // nothing is known before all links are true
  if (shown_) return;         // it says what it said
  if (from_links_ == FromLinks::kAfterEdit) {
    const auto behind = gather_ ? gather_->raysBehind() + gather_->looksBehind(in_mirrors_) : 0;
    if (behind > kRaysAtOnce) return;  // nor is it now: steps trace rays in slices
    // Somebody wants to know before the next step.
    tryNow([this] {
      do {
        while (!settleFromLinks()) continue;
      } while (!finishEdit() && !isRepairing());
    });
    return;
  }
  const auto [field, received, reflected] = assessField();
  error_ = {};
  double owed = 0.0, presumed = 0.0;  // by lights that are still to be measured; as lost, of what they send
  for (const auto& shooter : system_.shooters()) {
    for (const auto& column : shooter.column) {
      if (!shooter.isLight()) continue;
      if (column.points() == 0.0) owed += 0.5 * shooter.power();
      presumed += 0.5 * shooter.power() * column.totals().presumed / shooter.area;
    }
  }
  // Rays will bring what no shooter stands for, and what a wave that ended early did not measure.
  const auto sky = skyFlux();
  if (!gathers()) owed += inMirrors() + net_unshot_ + varying_ + planner_.unlinked(system_) + sky[0] + sky[1] + sky[2];
  if (field.square() <= 0.0) {
    const bool lacks = owed > 0.0 || (gathers() && gather_->bias() > 0.0);
    error_.residual = error_.total = lacks ? 1.0 : 0.0;  // all or nothing is missing
    return;
  }
  const double kept = std::min(kMostKept, (1.0 - lostPart()) * reflected / received);
  by_links_ = field.sampling();
  by_links_ = std::hypot(by_links_, std::sqrt(direct_smoothing_.bias() / field.square()));
  if (gathers()) by_links_ = std::hypot(by_links_, std::sqrt(gather_->bias() / field.square()));
  const double doubt = gathers() ? gather_->doubt() : 0.0;
  error_.sampling = std::hypot(by_links_, std::sqrt(doubt / field.square()));
  error_.discretization = field.discretization();
  double unsolved = gathers() ? gather_->unsolved() : 0.0;
  if (gathers())
    unsolved = std::clamp(std::sqrt(gather_->unsolvedSquare() / field.square()), kLeastUnsolved * unsolved, unsolved);
  error_.residual = (owed + presumed) / (1.0 - kept) / received + system_.unsolved() + unsolved;
  error_.residual = std::hypot(error_.residual, repair_.missing() / std::sqrt(field.square()));  // of links that wait
  error_.total = std::hypot(error_.residual, error_.sampling);
  if (!variation_.isTraced()) return;
  error_.sampling = std::hypot(by_links_, std::sqrt((variation_.noise() + doubt) / field.square()));
  error_.variation = std::sqrt(variation_.left() / field.square());
  error_.total = std::hypot(error_.residual, error_.sampling, error_.variation);
}

/// Light that lamps may send by way of mirrors, which comes with rays.
double LinkedSolver::inMirrors() const {
  double power = 0.0;
  for (const auto& shooter : system_.shooters()) power += mirrors_ && shooter.isLight() ? shooter.power() : 0.0;
  return power;
}

/// By leaf value, lm/m^2: what spreadByMirrors() tells of; empty: nothing.
std::vector<glm::vec3> LinkedSolver::spreadLight() const {
  if (!mirrors_ || sources_.empty()) return {};
  std::array<std::vector<glm::vec3>, 2> light;
  for (std::size_t half = 0; half < 2; ++half) system_.irradiance(half, light[half], LinkSystem::From::kSources);
  for (std::uint32_t value = 0; value < light[0].size(); ++value) {
    const auto arriving = 0.5F * (light[0][value] + light[1][value]);
    const bool is_imaged = in_mirrors_.sources.images && in_mirrors_.sources.images->isIn(value);
    const bool spreads = mirrors_->has(value) && !mirrors_->isGlass(value) && !is_imaged;
    light[0][value] = spreads ? mirrors_->meanReflectance(value) * arriving : glm::vec3(0.0F);
  }
  return std::move(light[0]);
}

std::array<double, 3> LinkedSolver::spreadFlux() const {
  std::array<double, 3> flux{};
  const auto light = spreadLight();
  for (std::uint32_t value = 0; value < light.size(); ++value) {
    for (std::size_t c = 0; c < 3; ++c)
      flux[c] += static_cast<double>(system_.leafAreas()[value] * light[value][static_cast<int>(c)]);
  }
  for (std::size_t c = 0; c < 3 && gathers(); ++c) flux[c] += gather_->spreadFlux()[c];
  return flux;
}

/// What flat mirrors reflect of lights that are no surfaces, and no leaf gets as an image: it leaves the scene, where
/// anything does. Nobody looks where it goes.
std::array<double, 3> LinkedSolver::imagesThatLeave() const {
  std::array<double, 3> flux{};
  if (!in_mirrors_.sources.images || !gathers()) return flux;
  const auto& escapes = gather_->escapedFlux();
  if (escapes[0] + escapes[1] + escapes[2] <= 0.0) return flux;
  std::array<std::vector<glm::vec3>, 2> light;
  for (std::size_t half = 0; half < 2; ++half) system_.irradiance(half, light[half], LinkSystem::From::kSources);
  for (std::uint32_t value = 0; value < light[0].size(); ++value) {
    if (!in_mirrors_.sources.images->isIn(value) || mirrors_->isGlass(value)) continue;
    const auto reflected = mirrors_->meanReflectance(value) * 0.5F * (light[0][value] + light[1][value]);
    for (std::size_t c = 0; c < 3; ++c)
      flux[c] += static_cast<double>(system_.leafAreas()[value] * reflected[static_cast<int>(c)]);
  }
  for (std::size_t c = 0; c < 3; ++c) flux[c] = std::max(0.0, flux[c] - gather_->imagedFlux()[c]);
  return flux;
}

double LinkedSolver::spreadByMirrors() const {
  const auto flux = spreadFlux();
  return flux[0] + flux[1] + flux[2];
}

LinkedSolver::FieldSums LinkedSolver::assessField() const {
  std::vector<std::optional<FieldSums>> of_side(sides_.size());
  const auto assessSide = [&](std::size_t s) {
    const auto& side = sides_[s];
    FieldSums sums{FieldError(*patches_)};  // of neighbours in memory many threads would wait for each other
    const auto leaves = [&](std::size_t half) {
      return std::span<const glm::vec3>(&half_[half][side.first_value], side.leaf_count);
    };
    sums.field.addSide(side, leaves(0), leaves(1));
    const auto reflectance = system_.reflectance().side(side.number);
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      const glm::vec3 flux = lightOf(side.first_value + leaf) * patches_->node_area[side.first_node + leaf];
      sums.received += static_cast<double>(channelSum(flux));
      sums.reflected += static_cast<double>(glm::dot(flux, reflectance[leaf]));
    }
    sums.reflected += static_cast<double>(channelSum(glm::vec3(passedFlux(side))));
    of_side[s].emplace(sums);
  };
  inTurns(sides_.size(), assessSide, system_.leafAreas().size() / kLeavesAThread);
  FieldSums all{FieldError(*patches_)};
  for (const auto& sums : of_side) {
    all.field.add(sums->field);
    all.received += sums->received;
    all.reflected += sums->reflected;
  }
  return all;
}

/// Flux that leaves a side since it arrived on the other.
glm::dvec3 LinkedSolver::passedFlux(const Side& side) const {
  glm::dvec3 flux(0.0);
  for (const auto& leaf : passingTo(system_.passing(), side)) flux += passedFlux(leaf);
  return flux;
}

glm::dvec3 LinkedSolver::passedFlux(const PassingLeaf& leaf) const {
  return glm::dvec3(leaf.transmittance * lightOf(leaf.from) * system_.leafAreas()[leaf.to]);
}

double LinkedSolver::fieldNorm() const {
  double square = 0.0;
  for (const auto& side : sides_) {
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      const auto light = lightOf(side.first_value + leaf);
      square += static_cast<double>(patches_->node_area[side.first_node + leaf] * glm::dot(light, light));
    }
  }
  return std::sqrt(square);
}

/// The stated error without what waits, of which an edit decides anew.
double LinkedSolver::errorBesideMissing() const {
  const double norm = fieldNorm(), waits = norm > 0.0 ? repair_.missing() / norm : 0.0;
  return std::sqrt(std::max(0.0, error_.total * error_.total - waits * waits));
}

/// After the light was solved for.
bool LinkedSolver::findsMoreDue() { return repair_.lacksLinks() && repair_.findsMoreDue(fieldNorm()); }

bool LinkedSolver::isDueForTarget() {
  if (error_.total <= settings_.target_error || !repair_.lacksLinks()) return false;
  return repair_.isDueForTarget(error_.total, fieldNorm());
}

/// Without memory or threads the next step will try again, and can say so.
void LinkedSolver::tryNow(const std::function<void()>& work) {
  try {
    work();
  } catch (const std::bad_alloc&) {
    pass_ = Pass::kNone;
  } catch (const std::system_error&) {
    pass_ = Pass::kNone;
  }
}

LinkCounters LinkedSolver::linkCounters() const {
  LinkCounters counters;
  counters.bytes = system_.bytes();
  counters.solutions = solutions_;
  counters.sweeps = sweeps_;
  counters.replayed = replayed_;
  counters.rows = system_.rowCount();
  if (gather_) {
    counters.bytes += gather_->sights().bytes();
    counters.rays = gather_->rays();
    counters.rays_kept = gather_->sights().kept();
  }
  repair_.addTo(counters);
  std::uint64_t nodes = 0;
  for (const auto& shooter : system_.shooters()) {
    nodes += shooter.isLight() ? 0 : 1;
    counters.shooters += shooter.column[0].points() + shooter.column[1].points() > 0.0 ? 1 : 0;
    counters.samples += shooter.column[0].samples() + shooter.column[1].samples();
  }
  counters.rows_saved = 3 * nodes > counters.rows ? 3 * nodes - counters.rows : 0;
  return counters;
}

/// Part of what the shooters of reflected light send that leaves the scene or falls on unlit sides: it never comes
/// back.
double LinkedSolver::lostPart() const {
  double sent = 0.0, lost = 0.0;
  for (const auto& shooter : system_.shooters()) {
    for (std::size_t half = 0; half < 2 && !shooter.isLight(); ++half) {
      const auto& column = shooter.column[half];
      const glm::dvec3 radiosity = shooter.carried(half) * glm::dvec3(shooter.sent[half]);
      if (column.points() == 0.0) continue;
      sent += shooter.area * (radiosity.x + radiosity.y + radiosity.z);
      lost += (column.escaped() + column.absorbed()) * (radiosity.x + radiosity.y + radiosity.z);
    }
  }
  return sent > 0.0 ? std::clamp(lost / sent, 0.0, 1.0) : 0.0;
}

/// Light that there is to shoot, with all its bounces: what stands in for the shooters' leaves, and what is unshot.
double LinkedSolver::powerToShoot() const {
  double shot = 0.0, received = 0.0, reflected = 0.0;
  for (const auto& shooter : system_.shooters()) {
    if (!shooter.isLight()) shot += shooter.power();
  }
  if (gathers()) return shot + net_unshot_;
  for (const auto& side : sides_) {
    const auto reflectance = system_.reflectance().side(side.number);
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      const glm::vec3 flux = lightOf(side.first_value + leaf) * patches_->node_area[side.first_node + leaf];
      received += static_cast<double>(channelSum(flux));
      reflected += static_cast<double>(glm::dot(flux, reflectance[leaf]));
    }
    reflected += static_cast<double>(channelSum(glm::vec3(passedFlux(side))));
  }
  const double kept = received > 0.0 ? std::min(0.95, (1.0 - lostPart()) * reflected / received) : 0.5;
  return shot + net_unshot_ / (1.0 - kept);
}

EnergyParts LinkedSolver::energy() const {
  EnergyParts parts;
  std::array<double, 3> sent_for{};  // by lights that have links, and by shooters for others
  for (const auto& shooter : system_.shooters()) {
    for (std::size_t c = 0; c < 3 && shooter.source != scene::kNone; ++c) {
      const double flux = shooter.area * static_cast<double>(shooter.sent[0][static_cast<int>(c)]);
      parts.emitted[c] += flux;
      for (const auto& column : shooter.column) {
        if (column.points() == 0.0) parts.unshot[c] += 0.5 * flux;
      }
    }
    for (std::size_t half = 0; half < 2; ++half) {
      const auto& column = shooter.column[half];
      if (column.points() == 0.0) continue;
      for (std::size_t c = 0; c < 3; ++c) {
        const double sent = 0.5 * shooter.carried(half) * static_cast<double>(shooter.sent[half][static_cast<int>(c)]);
        parts.escaped[c] += sent * column.escaped();
        parts.backface[c] += sent * column.absorbed();
        if (shooter.light != scene::kNone || shooter.crowd != scene::kNone) sent_for[c] += sent * shooter.area;
      }
    }
    if (gathers()) continue;  // rays make up for it
    // Shooters that won at roulette sent more than their own leaves have, those that lost nothing.
    for (std::size_t half = 0; half < 2 && !shooter.isLight(); ++half) {
      for (int c = 0; c < 3; ++c)
        sent_for[static_cast<std::size_t>(c)] +=
            0.5 * (shooter.weight[half] - 1.0) * static_cast<double>(shooter.sent[half][c]) * shooter.area;
    }
  }
  for (const auto& side : sides_) {
    const glm::dvec3 net(unshot_.flux(side.first_node + side.node_count - 1));
    const auto emission = system_.emission().side(side.number), reflectance = system_.reflectance().side(side.number);
    glm::dvec3 emitted(0.0), absorbed(0.0), specular(0.0);
    const auto takenBy = [&](std::uint32_t value) -> auto& {
      return mirrors_ && mirrors_->has(value) ? specular : absorbed;
    };
    for (const auto& leaf : passingTo(system_.passing(), side))  // where it arrives it counts as absorbed
      takenBy(leaf.from) -= passedFlux(leaf);
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      const auto area = static_cast<double>(patches_->node_area[side.first_node + leaf]);
      emitted += area * glm::dvec3(emission[leaf]);
      takenBy(side.first_value + leaf) +=
          area * (1.0 - glm::dvec3(reflectance[leaf])) * glm::dvec3(lightOf(side.first_value + leaf));
    }
    for (int c = 0; c < 3; ++c) {
      const auto i = static_cast<std::size_t>(c);
      parts.emitted[i] += emitted[c];
      parts.unshot[i] += net[c] + (side.gathered ? emitted[c] : 0.0);
      parts.absorbed[i] += absorbed[c];
      parts.specular[i] += specular[c];
    }
  }
  const auto sky = skyFlux(), spread = spreadFlux(), leaves = imagesThatLeave();
  for (std::size_t c = 0; c < 3; ++c) {
    parts.emitted[c] += sky[c];
    if (gathers()) {
      parts.escaped[c] += gather_->escapedFlux()[c] + sky[c] - gather_->skyFlux()[c] + leaves[c];
      parts.backface[c] += gather_->absorbedFlux()[c];
      parts.specular[c] -= gather_->mirroredFlux()[c] + spread[c] + leaves[c];
    } else {
      parts.unshot[c] += sky[c];
    }
    parts.unshot[c] -= sent_for[c];
    parts.imbalance[c] = parts.emitted[c] - parts.absorbed[c] - parts.specular[c] - parts.escaped[c] -
                         parts.backface[c] - parts.unshot[c];
    if (mirrors_ && (mirrors_->hasGlass() || !patches_->tints.empty()) && gathers())
      parts.specular[c] += std::exchange(parts.imbalance[c], 0.0);
  }
  return parts;
}

}  // namespace radiosity::solver
