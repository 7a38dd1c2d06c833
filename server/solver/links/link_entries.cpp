// The entries of LinkSystem's matrix: what a shooter's node gets over the links of another, for a radiosity of one.
#include <algorithm>
#include <glm/vec3.hpp>

#include "common/check.h"
#include "common/clones.h"
#include "server/solver/links/link_system.h"
#include "server/solver/math/halves.h"

namespace radiosity::solver {
namespace {

constexpr std::size_t kLanes = 8;

/// Sum of products in kLanes partial sums, so that it vectorises with the same bits everywhere.
RADIOSITY_CLONES float dot(const float* a, const float* b, std::size_t count) {
  float sum[kLanes] = {};
  std::size_t i = 0;
  for (; i + kLanes <= count; i += kLanes) {
    for (std::size_t k = 0; k < kLanes; ++k) sum[k] += a[i + k] * b[i + k];
  }
  float rest = 0.0F;
  for (; i < count; ++i) rest += a[i] * b[i];
  for (std::size_t k = 0; k < kLanes; ++k) rest += sum[k];
  return rest;
}

}  // namespace

void LinkSystem::makeRows() {
  const std::size_t count = shooters_.size();
  while (rows_.size() < count) {
    const Shooter& shooter = shooters_[rows_.size()];
    Rows row{static_cast<std::uint32_t>(halves_[0].matrix.size()), 0};
    if (!shooter.isLight()) row.count = uniform_[shooter.place.side] ? 1 : 3;
    for (auto& half : halves_) half.matrix.resize(row.first + row.count);
    rows_.push_back(row);
  }
  for (auto& half : halves_) {
    for (auto& row : half.matrix) row.reserve(count), row.resize(count, 0.0F);  // no room to spare: memory is bounded
  }
}

/// A column is made anew where its links changed, others for the nodes alone whose rows are not there yet.
void LinkSystem::updateColumns(std::size_t half, std::uint32_t first, std::uint32_t end) {
  thread_local std::vector<float> links, beyond;
  const auto& changed = changed_[half];
  const bool any_changed = std::find(changed.begin() + first, changed.begin() + end, true) != changed.begin() + end;
  for (std::uint32_t s = 0; s < sides_.size(); ++s) {
    const auto& members = members_[s];
    const bool has_new_rows = std::ranges::any_of(members, [&](std::uint32_t m) { return !hasRow(m); });
    if (members.empty() || (!any_changed && !has_new_rows)) continue;
    links.resize(sides_[s].leaf_count);
    beyond.resize(links.size());
    const bool lets_through = letsThrough(sides_[s]);
    for (auto column = first; column < end; ++column) {
      if (!changed[column] && !has_new_rows) continue;
      const auto& of_column = shooters_[column].column[half];
      SideLinks found;
      if (of_column.decode(sides_[s].first_value, links)) found.own = links.data();
      if (lets_through && of_column.decode(sides_[sides_[s].other].first_value, beyond)) found.beyond = beyond.data();
      if (found.own == nullptr && found.beyond == nullptr) continue;
      for (const auto m : members) {
        if (changed[column] || !hasRow(m)) fillRow(half, m, column, found);
      }
    }
  }
}

void LinkSystem::fillRow(std::size_t half, std::uint32_t member, std::uint32_t column, const SideLinks& links) {
  const NodePlace& place = shooters_[member].place;
  const Side& side = sides_[place.side];
  const auto rect = leafRect(side, place);
  const double whole = shooters_[member].area;
  const float* area = &patches_.node_area[side.first_node];
  const auto& row = rows_[member];
  if (row.count == 1) {
    double sum = 0.0;
    for (auto y = rect.y0; y < rect.y1; ++y) {
      const auto first = y * side.width + rect.x0;
      sum += static_cast<double>(dot(area + first, links.own + first, rect.x1 - rect.x0));
    }
    halves_[half].matrix[row.first][column] = static_cast<float>(sum / whole);
    return;
  }
  glm::dvec3 sum(0.0);
  const auto reflectance = reflectance_.side(side.number);
  for (auto y = rect.y0; y < rect.y1; ++y) {
    for (auto x = rect.x0; x < rect.x1; ++x) {
      const auto leaf = y * side.width + x;
      if (links.own != nullptr) sum += glm::dvec3(area[leaf] * links.own[leaf] * reflectance[leaf]);
      if (links.beyond != nullptr)
        sum += glm::dvec3(area[leaf] * links.beyond[leaf] * transmittance_.side(side.number)[leaf]);
    }
  }
  for (int c = 0; c < 3; ++c)
    halves_[half].matrix[row.first + static_cast<std::uint32_t>(c)][column] = static_cast<float>(sum[c] / whole);
}

/// The halves side by side.
void LinkSystem::inheritEntries(const LinkSystem& former, const FormerEntries& same) {
  makeRows();
  const auto count = static_cast<std::uint32_t>(shooters_.size());
  no_row_.assign(count, true);
  for (std::uint32_t m = 0; m < count; ++m) {
    const auto old_row = same.row[m];
    no_row_[m] = old_row == scene::kNone || old_row >= former.known_ || !former.hasRow(old_row) ||
                 !hasSameReflectance(m, former, old_row);
  }
  known_ = count;
  inBothHalves([&](std::size_t half) {
    std::vector<std::uint32_t> columns;
    for (std::uint32_t n = 0; n < count; ++n) {
      const auto old_column = same.column[half][n];
      if (old_column == scene::kNone || old_column >= former.known_ || former.changed_[half][old_column]) continue;
      changed_[half][n] = false;
      columns.push_back(n);
    }
    for (std::uint32_t m = 0; m < count; ++m) {
      for (std::uint32_t r = 0; !no_row_[m] && r < rows_[m].count; ++r) {
        auto& row = halves_[half].matrix[rows_[m].first + r];
        const auto& old_row = former.halves_[half].matrix[former.rows_[same.row[m]].first + r];
        for (const auto n : columns) row[n] = old_row[same.column[half][n]];
      }
    }
  });
}

/// Where rows hold it.
bool LinkSystem::hasSameReflectance(std::uint32_t member, const LinkSystem& former, std::uint32_t old_member) const {
  if (rows_[member].count != former.rows_[old_member].count) return false;
  if (rows_[member].count <= 1) return true;
  const NodePlace &place = shooters_[member].place, &old_place = former.shooters_[old_member].place;
  const Side &side = sides_[place.side], &old_side = former.sides_[old_place.side];
  const auto rect = leafRect(side, place);
  const auto isSame = [&](const scene::SideColours& in_this, const scene::SideColours& in_former) {
    const auto now = in_this.side(side.number), before = in_former.side(old_side.number);
    for (auto y = rect.y0; y < rect.y1; ++y) {
      for (auto x = rect.x0; x < rect.x1; ++x) {
        if (now[y * side.width + x] != before[y * side.width + x]) return false;
      }
    }
    return true;
  };
  if (!isSame(reflectance_, former.reflectance_)) return false;
  const bool lets_through = letsThrough(side);
  if (lets_through != former.letsThrough(old_side)) return false;
  return !lets_through || isSame(transmittance_, former.transmittance_);
}

}  // namespace radiosity::solver
