#include "server/solver/links/link_memory.h"

#include <algorithm>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "common/parallel.h"

namespace radiosity::solver {
namespace {

/// New shooters leave this part of the memory to further samples, which may reach sides that the first did not.
constexpr std::size_t kGrowthPart = 16;
/// Less than the heights (unit box) above which the renderer takes something for being in front of a plane.
constexpr float kInFront = 5e-7F;

/// Height of the box's highest corner above a plane.
float highest(const glm::vec3& point, const glm::vec3& normal, const glm::vec3& low, const glm::vec3& high) {
  const glm::vec3 corner(normal.x > 0.0F ? high.x : low.x, normal.y > 0.0F ? high.y : low.y,
                         normal.z > 0.0F ? high.z : low.z);
  return glm::dot(normal, corner - point);
}

/// Of both halves.
std::size_t matrixBytes(std::size_t rows, std::size_t shooters) { return 2 * sizeof(float) * rows * shooters; }

/// Sides that all views look at before the next: their surfaces stay in the cache meanwhile.
constexpr std::size_t kSidesAtATime = 1024;

std::size_t bytesOf(const Side& side) { return side.leaf_count * LinkColumn::kLeafBytes + sizeof(LinkColumn::Run); }

}  // namespace

LinkMemory::LinkMemory(const scene::PatchScene& patches, const std::vector<Side>& sides, std::size_t bytes)
    : patches_(patches), sides_(sides), bytes_(bytes), side_bytes_(sides.size(), 0) {
  all_bytes_ = bytesOfSides([](const Side&) { return true; });
}

template <typename Sees>
std::size_t LinkMemory::bytesOfSides(Sees sees) const {
  std::size_t bytes = 0;
  for (const auto& side : sides_) {
    if (sees(side)) bytes += bytesOf(side);
  }
  return bytes;
}

/// Whether a polygon inside a box, in a plane, and a side can have something in front of each other.
bool LinkMemory::canReach(const View& from, const Side& receiver) const {
  const auto& surface = patches_.surfaces[receiver.surface];
  if (highest(from.point, from.normal, surface.bounds_min, surface.bounds_max) <= kInFront) return false;
  if (!surface.planar) return true;
  const auto& plane = patches_.triangles[surface.first_triangle];
  const float up = receiver.side == 0 ? 1.0F : -1.0F;
  return highest(plane.origin, up * plane.normal, from.low, from.high) > -kInFront;
}

std::size_t LinkMemory::mostBytes(std::uint32_t side) {
  if (side_bytes_[side] == 0) learn({side});
  return side_bytes_[side];
}

/// Of a planar side.
LinkMemory::View LinkMemory::viewFrom(std::uint32_t side) const {
  const auto& surface = patches_.surfaces[sides_[side].surface];
  const auto& frame = patches_.triangles[surface.first_triangle];
  return {frame.origin, sides_[side].side == 0 ? frame.normal : -frame.normal, surface.bounds_min, surface.bounds_max};
}

void LinkMemory::addBytes(std::span<const View> views, std::span<const Side> receivers,
                          std::span<std::size_t> bytes) const {
  for (std::size_t v = 0; v < views.size(); ++v) {
    for (const auto& receiver : receivers) {
      if (canReach(views[v], receiver)) bytes[v] += bytesOf(receiver);
    }
  }
}

void LinkMemory::learn(std::vector<std::uint32_t> sides) {
  std::erase_if(sides, [&](std::uint32_t side) {
    if (!patches_.surfaces[sides_[side].surface].planar) side_bytes_[side] = all_bytes_;
    return side_bytes_[side] > 0;
  });
  std::ranges::sort(sides);
  sides.erase(std::unique(sides.begin(), sides.end()), sides.end());
  if (sides.empty()) return;
  std::vector<View> views;
  for (const auto side : sides) views.push_back(viewFrom(side));
  const auto blocks = (sides_.size() + kSidesAtATime - 1) / kSidesAtATime;
  std::vector<std::vector<std::size_t>> bytes(std::min(blocks, mostShares()), std::vector<std::size_t>(views.size()));
  inShares(bytes.size(), [&](std::size_t share, std::size_t shares) {
    for (auto block = share; block < blocks; block += shares) {
      const auto first = block * kSidesAtATime, count = std::min(kSidesAtATime, sides_.size() - first);
      addBytes(views, std::span(sides_).subspan(first, count), bytes[share]);
    }
  });
  for (std::size_t v = 0; v < views.size(); ++v) {
    std::size_t all = 0;
    for (const auto& part : bytes) all += part[v];
    side_bytes_[sides[v]] = std::max<std::size_t>(all, 1);
  }
}

std::size_t LinkMemory::mostBytes(const LightPolygon& light) const {
  glm::vec3 low = light.corners[0], high = low;
  for (std::uint32_t i = 1; i < light.corner_count; ++i) {
    low = glm::min(low, light.corners[i]);
    high = glm::max(high, light.corners[i]);
  }
  const View view{light.corners[0], light.normal, low, high};
  return bytesOfSides([&](const Side& side) { return canReach(view, side); });
}

void LinkMemory::begin(const LinkSystem& system) {
  taken_ = system.bytes();
  rows_ = system.rowCount();
  shooters_ = system.shooters().size();
  lacks_samples_ = false;
}

bool LinkMemory::isMostlyRows(const LinkSystem& system) const {
  std::size_t rows = 0;
  for (const auto& shooter : system.shooters()) rows += shooter.isLight() ? 0 : system.rowsOf(shooter.place.side);
  return matrixBytes(rows, system.shooters().size()) > bytes_ / 2;
}

bool LinkMemory::takeShooter(const Shooter& shooter, std::size_t columns, const LinkSystem& system) {
  const std::size_t links = columns * shooter.most_bytes, rows = rows_ + system.rowsOf(shooter.place.side);
  const std::size_t count = shooters_ + 1;
  const std::size_t matrix = matrixBytes(rows, count) - matrixBytes(rows_, shooters_);
  if (taken_ + links + matrix > bytes_ - bytes_ / kGrowthPart) {
    full_ = true;
    return false;
  }
  taken_ += links + matrix;
  rows_ = rows;
  shooters_ = count;
  return true;
}

bool LinkMemory::takeSample(const Shooter& shooter, std::size_t half) {
  const std::size_t has = shooter.column[half].bytes();
  const std::size_t more = shooter.most_bytes > has ? shooter.most_bytes - has : 0;
  if (taken_ + more > bytes_ && more > 0) {
    lacks_samples_ = true;
    return false;
  }
  taken_ += more;
  return true;
}

}  // namespace radiosity::solver
