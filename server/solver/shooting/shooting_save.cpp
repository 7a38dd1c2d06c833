// ShootingSolver as bytes and back: H and S, and what its choices depend on.
#include <algorithm>

#include "server/solver/shooting/shooting_solver.h"

namespace radiosity::solver {
namespace {

constexpr std::uint32_t kKind = 0x33544853U;  // "SHT3": what there is below

}  // namespace

bool RadiosityState::isWhole() const {
  const auto nodes = patches_->nodeCount(), values = irradiance_.size();
  return received_[0].size() == nodes && received_[1].size() == nodes && shot_.size() == values &&
         shot_level_.size() == values && irradiance_.size() == values && unshot_.size() == values &&
         node_rough_.size() == nodes && node_flux_.size() == nodes;
}

template <typename Archive, typename Self>
void ShootingSolver::visit(Archive& archive, Self& self) {
  archive(self.phase_, self.live_, self.wave_is_direct_, self.gather_emitted_, self.irradiance_, self.error_,
          self.transport_counters_);
  RadiosityState::visit(archive, self.state_);
  DirectShots::visit(archive, self.direct_);
  PunctualLights::visit(archive, self.punctual_);
  Planner::visit(archive, self.planner_);
}

bool ShootingSolver::save(ArchiveWriter& to) const {
  if (wave_.underWay()) return false;
  to(kKind, static_cast<std::uint64_t>(state_.patches().nodeCount()));
  visit(to, *this);
  return true;
}

bool ShootingSolver::restore(ArchiveReader& from) {
  std::uint32_t kind = 0;
  std::uint64_t nodes = 0;
  from(kind, nodes);
  if (!from.ok() || kind != kKind || nodes != state_.patches().nodeCount()) return false;
  const auto sides = state_.sides().size();
  visit(from, *this);
  return from.ok() && state_.isWhole() && direct_.isWhole() && state_.sides().size() == sides &&
         irradiance_.size() == nodes;
}

}  // namespace radiosity::solver
