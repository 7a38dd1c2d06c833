#include "server/solver/surface/place_light.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <numeric>

#include "common/parallel.h"
#include "common/task.h"
#include "server/solver/lamps/unhidden.h"
#include "server/solver/math/polygon_form_factor.h"
#include "server/solver/math/sampling.h"
#include "server/solver/patches/unshot_pyramid.h"
#include "server/solver/rays/ray_order.h"
#include "server/solver/surface/mirror_walk.h"

namespace radiosity::solver {
namespace {

/// Of more lamps than these some are drawn.
constexpr std::size_t kEachLamp = 32;
constexpr std::uint32_t kDraws = 64;
/// Points on a lamp that look first, and so many where these do not agree.
constexpr std::uint32_t kFirstLooks = 8, kAllLooks = PlaceLight::kMostLooks;
static_assert(kFirstLooks % geometry::kPacket == 0 && kAllLooks % geometry::kPacket == 0 &&
              kAllLooks <= TintedRays::kMostPoints);
/// Where the first agree the others are asked with this chance.
constexpr double kAskAgain = 0.25;
/// Points of a lamp that is no surface.
constexpr std::uint32_t kLampLooks = 32;
/// Rays of a look at an image: to the mirror, and from there to the lamp.
constexpr std::uint32_t kRaysOfLook = 2;
/// A ray goes on from so many leaves at most that something cuts.
constexpr std::size_t kMostSteps = 8;
/// Rays in all directions for each look at what is far brighter than the rest.
constexpr std::uint32_t kRaysALook = 2;
/// No ray has this number.
constexpr std::uint64_t kLookKey = ~std::uint64_t{0};
constexpr std::uint64_t kSpreadSeed = 0x5bd1e995;
/// Shadow rays for that, at most: half a second of one core.
constexpr std::size_t kMostSpreadLooks = 500'000;
/// What a way in single precision is sent to is known to so much (unit box), times what the cosine there makes of it:
/// rays start a little before their places.
constexpr double kNearEnd = 1e-5;

float strongest(const glm::vec3& colour) { return std::max({colour.x, colour.y, colour.z}); }

}  // namespace

PlaceLight::PlaceLight(const SolvedScene& solved)
    : patches_(solved.patches),
      sides_(std::make_shared<std::vector<Side>>(makeSides(patches_))),
      rays_(solved.rays ? solved.rays : std::make_shared<const LeafRays>(patches_, *sides_)),
      tinted_(rays_),
      normals_(solved.normals) {
  auto lamps = findLightPolygons(patches_, *sides_, solved.materials.emission);
  std::erase_if(lamps, [](const LightPolygon& lamp) { return lamp.emission == glm::vec3(0.0F); });
  if (lamps.size() <= kEachLamp) {
    lamps_ = std::move(lamps);
  } else {
    std::vector<float> strengths;
    for (const auto& lamp : lamps) strengths.push_back(strongest(lamp.emission));
    many_.emplace(std::move(lamps), strengths);
  }
  const PunctualLights punctual(patches_, solved.sources, {});
  sources_ = punctual.makeSources(patches_, solved.sources);
  sky_.emplace(sources_);
  std::erase_if(sources_, [](const auto& source) { return source.kind == PunctualLights::Source::Kind::kSky; });
  for (const auto& side : *sides_) {
    const auto emission = solved.materials.emission.side(side.number);
    const auto reflectance = solved.materials.reflectance.side(side.number);
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      emission_.push_back(side.gathered ? glm::vec3(0.0F) : emission[leaf]);
      reflectance_.push_back(reflectance[leaf]);
    }
  }
  takeMirrors(solved.materials);
  passing_ = passingLeaves(solved.materials.transmittance, *sides_, leafAreas(patches_, *sides_));
  setIrradiance(solved.irradiance, solved.difference);
}

void PlaceLight::takeMirrors(const scene::PatchMaterials& materials) {
  mirrors_ = SpecularLeaves::find(*sides_, materials, patches_.surfaces);
  if (!mirrors_) return;
  for (const auto& side : *sides_) {
    const auto emission = materials.emission.side(side.number);
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf)
      lamp_emission_.push_back(side.gathered ? emission[leaf] : glm::vec3(0.0F));
  }
  const auto find = [&](std::span<const LightPolygon> lamps, std::span<const PunctualLights::Source> sources) {
    return Images{LampImages::find(patches_, *sides_, rays_, mirrors_, lamps, sources),
                  LampImages::lightOf(lamps, sources)};
  };
  const auto areas = leafAreas(patches_, *sides_);
  least_imaged_ = LampImages::leastEmission(lamps_, std::reduce(areas.begin(), areas.end(), 0.0));
  std::vector<LightPolygon> bright;
  std::ranges::copy_if(lamps_, std::back_inserter(bright),
                       [&](const LightPolygon& lamp) { return channelSum(lamp.emission) > least_imaged_; });
  lamp_images_ = find(bright, {});
  source_images_ = find({}, sources_);
  glints_ = LampGlints(lamps_);
  if (!sources_.empty()) spreadSources();
}

/// What is found in mirrors neither by rays nor as an image leaves these as if it was diffuse
/// (Solver::spreadByMirrors). A bounded number of leaves is asked; the others have what the one before them has.
void PlaceLight::spreadSources() {
  std::vector<std::uint32_t> spreading;
  for (const auto& side : *sides_) {
    for (auto value = side.first_value; value < side.first_value + side.leaf_count; ++value)
      if (mirrors_->has(value) && !mirrors_->isGlass(value) && rays_->areaOf(value) > 0.0) spreading.push_back(value);
  }
  std::size_t looks = 0;
  for (const auto& source : sources_) looks += source.kind == PunctualLights::Source::Kind::kLamp ? kLampLooks : 1;
  const std::size_t step = 1 + spreading.size() * looks / kMostSpreadLooks;
  inTurns((spreading.size() + step - 1) / step, [&](std::size_t block) {
    interruptionPoint();
    const auto value = spreading[block * step];
    const auto draw = sobol4(0, mixKeys(kSpreadSeed, value));
    const auto spot = spotOn(value, {draw.x, draw.y});
    const auto key = mixKeys(kSpreadSeed + 1, value);
    auto arrives = glm::vec3(fromImages(source_images_, spot, key, Looks::kFewer));
    if (!source_images_.isIn(value)) arrives += glm::vec3(fromSources(spot, key));
    for (auto i = block * step; i < std::min(spreading.size(), (block + 1) * step); ++i)
      emission_[spreading[i]] += mirrors_->meanReflectance(spreading[i]) * arrives;
  });
}

void PlaceLight::setIrradiance(std::span<const glm::vec3> irradiance, std::span<const glm::vec3> difference) {
  radiosity_ = emission_;
  off_.assign(difference.empty() ? 0 : emission_.size(), glm::vec3(0.0F));
  for (const auto& side : *sides_) {
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      const auto value = side.first_value + leaf;
      radiosity_[value] += reflectance_[value] * irradiance[side.first_node + leaf];
      // Of the mean of two, half of what they differ by.
      if (!off_.empty()) off_[value] = 0.5F * reflectance_[value] * difference[side.first_node + leaf];
    }
  }
  passed_.assign(passing_.empty() ? 0 : radiosity_.size(), glm::vec3(0.0F));
  for (const auto& leaf : passing_) {
    const auto& side = (*sides_)[rays_->sideOf(leaf.from).number];
    const auto node = side.first_node + leaf.from - side.first_value;
    passed_[leaf.to] = leaf.transmittance * irradiance[node];
    radiosity_[leaf.to] += passed_[leaf.to];
    if (!off_.empty()) off_[leaf.to] += 0.5F * leaf.transmittance * difference[node];
  }
  bright_ = BrightLeaves::find(patches_, *rays_, radiosity_, mirrors_.get());
}

PlaceLight::Spot PlaceLight::spotOn(std::uint32_t value, const glm::vec2& at) const {
  Spot spot;
  spot.place = rays_->placeOn(value, at);
  spot.texel = glm::vec2(rays_->texelOf(spot.place));
  const bool is_front = rays_->sideOf(value).side == 0;
  spot.shading = spot.place.normal;
  if (normals_ && normals_->has(spot.place.triangle)) {
    const auto front = is_front ? spot.place.normal : -spot.place.normal;
    const auto shading = normals_->at(spot.place.triangle, spot.texel, front);
    spot.shading = is_front ? shading : -shading;
  }
  return spot;
}

glm::dvec3 PlaceLight::arriving(const Spot& spot, std::uint64_t key) const {
  return direct(spot, mixKeys(key, 1), Looks::kFewer) + reflected(spot, mixKeys(key, 2), kRays).light;
}

PlaceLight::Arriving PlaceLight::arriving(const Spot& spot, std::uint64_t key, std::uint32_t rays) const {
  const auto gathered = reflected(spot, mixKeys(key, 2), rays);
  return {direct(spot, mixKeys(key, 1), Looks::kAll), gathered.light, gathered.off};
}

std::uint64_t PlaceLight::looksAPoint(std::uint32_t rays) const {
  std::uint64_t looks = kAllLooks * lamps_.size() + (many_ ? kDraws : 0) + (bright_ ? rays / kRaysALook : 0);
  for (const auto& source : sources_) looks += source.kind == PunctualLights::Source::Kind::kLamp ? kLampLooks : 1;
  for (const auto* images : {lamp_images_.images.get(), source_images_.images.get()})
    if (images != nullptr) looks += std::uint64_t{kRaysOfLook} * kAllLooks * images->images().size();
  return looks;
}

/// Rays are drawn by the cosine with the geometric normal, and count by that with the other.
PlaceLight::Gathered PlaceLight::reflected(const Spot& spot, std::uint64_t key, std::uint32_t rays) const {
  const SampleCounts counts{rays, bright_ ? std::max(1U, rays / kRaysALook) : 0};
  const Sobol4 draws(key);
  RayOrder order;
  for (std::uint32_t k = 0; k < rays; ++k) order.add(k, draws(k));
  order.sort();
  std::array<LeafRays::Place, geometry::kPacket> from;
  from.fill(spot.place);
  std::array<glm::dvec3, geometry::kPacket> direction;
  std::array<geometry::Hit, geometry::kPacket> hit;
  Gathered sum;
  for (std::size_t first = 0; first < order.size(); first += geometry::kPacket) {
    const auto together = std::min<std::size_t>(geometry::kPacket, order.size() - first);
    for (std::size_t i = 0; i < together; ++i)
      direction[i] = cosineDirection(spot.place.normal, order[first + i].draw.x, order[first + i].draw.y);
    rays_->meetFirst(std::span(from).first(together), std::span(direction).first(together),
                     std::span(hit).first(together));
    for (std::size_t i = 0; i < together; ++i) {
      const double cosine = glm::dot(spot.place.normal, direction[i]);
      const double weight = std::max(0.0, glm::dot(spot.shading, direction[i])) / std::max(cosine, 1e-6);
      if (weight <= 0.0) continue;
      const auto of_ray = mixKeys(key, order[first + i].number);
      LeafRays::Place end;
      glm::dvec3 tint(1.0);
      const auto value = tinted_.see(spot.place, direction[i], of_ray, end, tint, &hit[i]);
      double share = weight / rays;
      if (bright_ && value == end.value && value < radiosity_.size() && bright_->density(value) > 0.0)
        share = counts.weight(cosine, glm::dot(spot.shading, direction[i]), -glm::dot(end.normal, direction[i]),
                              glm::distance(end.position, spot.place.position), bright_->density(value));
      sum.light +=
          share * tint *
          (leaving(value, end, of_ray, kMostSteps) + alongMirrors({value, end, direction[i], of_ray, kMostSteps}));
      if (!off_.empty() && value < off_.size()) sum.off += weight * tint * glm::dvec3(off_[value]);
    }
  }
  if (bright_) sum.light += fromBright(spot, mixKeys(key, kLookKey), counts);
  return {sum.light, sum.off / static_cast<double>(rays)};
}

/// What rays in all directions would seldom meet, by looks at some of its places.
glm::dvec3 PlaceLight::fromBright(const Spot& spot, std::uint64_t key, const SampleCounts& counts) const {
  const Sobol4 draws(key);
  std::array<LeafRays::Place, geometry::kPacket> from, there;
  from.fill(spot.place);
  std::array<glm::dvec3, geometry::kPacket> direction;
  std::array<std::uint64_t, geometry::kPacket> of_look{};
  std::array<geometry::Hit, geometry::kPacket> hit;
  std::size_t together = 0;
  glm::dvec3 sum(0.0);
  const auto look = [&] {
    rays_->meetFirst(std::span(from).first(together), std::span(direction).first(together),
                     std::span(hit).first(together));
    for (std::size_t i = 0; i < together; ++i) {
      LeafRays::Place end;
      glm::dvec3 tint(1.0);
      const auto value = tinted_.see(spot.place, direction[i], of_look[i], end, tint, &hit[i]);
      const double leaves = -glm::dot(there[i].normal, direction[i]);
      // Rays start a little before their places, and may end beyond the edge of the leaf.
      if (value >= radiosity_.size() || rays_->sideOf(value).number != rays_->sideOf(there[i].value).number) continue;
      if (leaves * glm::distance(end.position, there[i].position) > kNearEnd) continue;
      sum += counts.weight(glm::dot(spot.place.normal, direction[i]), glm::dot(spot.shading, direction[i]), leaves,
                           glm::distance(there[i].position, spot.place.position), bright_->density(there[i].value)) *
             tint * glm::dvec3(radiosity_[there[i].value]);
    }
    together = 0;
  };
  for (std::uint32_t k = 0; k < counts.looks; ++k) {
    const auto draw = draws(k);
    there[together] = bright_->draw(*rays_, draw.x, {draw.y, draw.z});
    const auto way = there[together].position - spot.place.position;
    const double length = glm::length(way);
    if (!(length > kNearEnd) || glm::dot(there[together].normal, way) >= 0.0) continue;
    if (glm::dot(spot.place.normal, way) <= 0.0 || glm::dot(spot.shading, way) <= 0.0) continue;
    direction[together] = way / length;
    of_look[together] = mixKeys(key, k);
    if (++together == geometry::kPacket) look();
  }
  if (together > 0) look();
  return sum;
}

/// By one ray.
glm::dvec3 PlaceLight::reflectedBy(const Spot& spot, std::uint64_t key, std::size_t steps) const {
  const auto draw = sobol4(0, key);
  LeafRays::Place end;
  const auto direction = cosineDirection(spot.place.normal, draw.x, draw.y);
  glm::dvec3 tint(1.0);
  const auto value = tinted_.see(spot.place, direction, key, end, tint);
  return tint * (leaving(value, end, key, steps) + alongMirrors({value, end, direction, key, steps}));
}

/// What a ray that met a mirror sees in it, beside the light of the mirror's own leaf. Lamps count in full there, since
/// direct light does not come by way of mirrors, but for those that are looked for as images.
glm::dvec3 PlaceLight::alongMirrors(const Met& met) const {
  if (!mirrors_) return glm::dvec3(0.0);
  const RayEnd first{met.value, met.end, met.direction, met.key};
  auto sum = glints_.look(tinted_, *mirrors_, first);
  followMirrors(tinted_, mirrors_.get(), first, [&](const RayEnd& at, const glm::dvec3& part, const MirrorHop& hop) {
    sum += part * leaving(at.value, at.end, at.key, met.steps);
    if (at.value >= lamp_emission_.size() || lamp_emission_[at.value] == glm::vec3(0.0F)) return;
    const auto& emission = lamp_emission_[at.value];
    const bool is_first = hop.number == 0 && hop.bounces == 1;
    if (is_first && lamp_images_.isIn(hop.mirror) && channelSum(emission) > least_imaged_) return;
    const double weight = is_first ? glints_.weightOf(*mirrors_, first, at, emission) : 1.0;
    sum += weight * part * glm::dvec3(emission);
  });
  return sum;
}

/// Towards whoever sees it there: of a leaf that something cuts the light of that very place.
glm::dvec3 PlaceLight::leaving(std::uint32_t value, const LeafRays::Place& end, std::uint64_t key,
                               std::size_t steps) const {
  if (LeafRays::isSky(value)) return sky_->at(value - LeafRays::kSky);
  if (value == LeafRays::kNothing) return glm::dvec3(0.0);
  const bool is_mirror = mirrors_ && mirrors_->has(value);
  if (steps == 0 || value != end.value || !rays_->isCut(value) || is_mirror) return glm::dvec3(radiosity_[value]);
  const Spot there{end, end.normal, {}};
  const auto arrives = direct(there, mixKeys(key, 3), Looks::kFewer) + reflectedBy(there, mixKeys(key, 4), steps - 1);
  const auto passed = passed_.empty() ? glm::vec3(0.0F) : passed_[value];
  return glm::dvec3(emission_[value] + passed) + glm::dvec3(reflectance_[value]) * arrives;
}

glm::dvec3 PlaceLight::direct(const Spot& spot, std::uint64_t key, Looks looks) const {
  glm::dvec3 sum(0.0);
  for (std::size_t i = 0; i < lamps_.size(); ++i)
    sum += fromLamp(lamps_[i], spot, mixKeys(key, i), looks) * glm::dvec3(lamps_[i].emission);
  if (many_) sum += fromSomeLamps(spot, key);
  if (lamp_images_.images) sum += fromImages(lamp_images_, spot, mixKeys(key, 5), looks);
  if (source_images_.images) sum += fromImages(source_images_, spot, mixKeys(key, 6), looks);
  return sum + fromSources(spot, key);
}

/// By some points of each, as of lamps themselves.
glm::dvec3 PlaceLight::fromImages(const Images& images, const Spot& spot, std::uint64_t key, Looks looks) const {
  glm::dvec3 sum(0.0);
  for (std::size_t i = 0; images.images && i < images.images->images().size(); ++i) {
    const auto& image = images.images->images()[i];
    if (!images.images->maySee(image, spot.place.position, 0.0)) continue;
    const auto of_image = mixKeys(key, i);
    const Sobol4 draws(of_image);
    LampImages::Looks some;
    const auto look = [&](std::uint32_t first, std::uint32_t end) {
      for (auto k = first; k < end; ++k) {
        const auto at = draws(k);
        some.add(images.images->look(image, spot.place, spot.shading, {at.x, at.y}));
      }
      return images.images->irradiance(image, some, std::span(&spot.place, 1), &spot.shading);
    };
    const auto light = glm::dvec3(images.light[image.lamp]);
    const auto first = look(0, kFirstLooks);
    const bool agree = some.seen_count == 0 || some.seen_count == some.count;
    if (looks == Looks::kFewer && agree && uniformFromKey(of_image) >= kAskAgain) {
      sum += light * first;
      continue;
    }
    const auto all = look(kFirstLooks, kAllLooks);
    sum += light * (looks == Looks::kFewer && agree ? first + (all - first) / kAskAgain : all);
  }
  return sum;
}

glm::dvec3 PlaceLight::fromSources(const Spot& spot, std::uint64_t key) const {
  glm::dvec3 sum(0.0);
  for (std::size_t i = 0; i < sources_.size(); ++i) {
    const auto& place = spot.place;
    if (sources_[i].kind == PunctualLights::Source::Kind::kLamp) {
      sum += fromLampOfSize(sources_[i].lamp(), spot, mixKeys(key, ~i)) * sources_[i].intensity;
      continue;
    }
    auto shaded = place;
    shaded.normal = spot.shading;
    const auto look = lookAt(sources_[i], shaded, {});
    if (look.brings > 0.0 && glm::dot(place.normal, look.way) > 0.0)
      sum += look.brings * tinted_.passageTo(place, place.position + look.way, glm::dvec3(0.0), mixKeys(key, ~i)) *
             sources_[i].intensity;
  }
  return sum;
}

/// For an intensity of one, by some of its points.
glm::dvec3 PlaceLight::fromLampOfSize(const Lamp& lamp, const Spot& spot, std::uint64_t key) const {
  const auto& place = spot.place;
  const Sobol4 draws(key);
  const auto whole = static_cast<float>(wholeIrradiance(lamp, place.position, spot.shading));
  const std::uint32_t count = lamp.shape.kind == LampShape::Kind::kWeb ? 1 : kLampLooks;
  LampLooks looks;
  double seen = 0.0;
  glm::dvec3 light(0.0);
  for (std::uint32_t k = 0; k < count; ++k) {
    const auto draw = draws(k);
    const auto point = lampPoint(lamp, place.position, spot.shading, {draw.x, draw.y});
    const auto brings = static_cast<float>(point.brings);
    const float all = lamp.shape.hasClosedForm() ? whole : brings;
    if (!(brings > 0.0F)) {
      looks.pass(lamp.shape.hasClosedForm() ? whole : 0.0F);
      continue;
    }
    looks.ask(all, brings);
    if (glm::dot(place.normal, point.position - place.position) <= 0.0) continue;  // the surface itself hides it
    const auto passes = tinted_.passageTo(place, point.position, glm::dvec3(0.0), mixKeys(key, k));
    if (passes == glm::dvec3(0.0)) continue;
    looks.see(all, brings);
    seen += point.brings;
    light += point.brings * passes;
  }
  return seen > 0.0 ? static_cast<double>(looks.irradiance(count)) * (light / seen) : glm::dvec3(0.0);
}

/// For an emission of one: the exact form factor of all of it, times the part of that which is seen.
glm::dvec3 PlaceLight::fromLamp(const LightPolygon& lamp, const Spot& spot, std::uint64_t key, Looks looks) const {
  const auto& place = spot.place;
  if (unhiddenLight(lamp, place) <= 0.0) return glm::dvec3(0.0);
  const std::span corners(lamp.corners.data(), lamp.corner_count);
  const auto factors = formFactorsAboveBoth(place.position, place.normal, spot.shading, corners);
  if (factors.shading <= 0.0) return glm::dvec3(0.0);
  Seen seen;
  if (looks == Looks::kAll) {
    look(lamp, spot, key, 0, kAllLooks, seen);
    return factors.shading * seen.mean();
  }
  look(lamp, spot, key, 0, kFirstLooks, seen);
  const auto first = seen.mean();
  const bool agree = seen.agree();
  if (agree && uniformFromKey(key) >= kAskAgain) return factors.shading * first;
  look(lamp, spot, key, kFirstLooks, kAllLooks, seen);
  // Those that are asked although the first agree stand for those that are not: else what lies just within the edge of
  // a shadow would count as all dark, or all lit, too often.
  return factors.shading * (agree ? first + (seen.mean() - first) / kAskAgain : seen.mean());
}

/// By points first .. end - 1 of the lamp, beside those that were seen before.
void PlaceLight::look(const LightPolygon& lamp, const Spot& spot, std::uint64_t key, std::uint32_t first,
                      std::uint32_t end, Seen& seen) const {
  const auto& place = spot.place;
  const Sobol4 draws(key);
  std::array<glm::dvec3, kAllLooks> point;
  std::array<double, kAllLooks> weight{};
  for (auto k = first; k < end; ++k) {
    const auto at = draws(k);
    point[k] = glm::dvec3(lamp.point(at.x, at.y));
    const auto way = point[k] - place.position;
    const double leaves = -glm::dot(glm::dvec3(lamp.normal), way), square = glm::dot(way, way);
    if (glm::dot(place.normal, way) > 0.0 && leaves > 0.0)
      weight[k] = std::max(0.0, glm::dot(spot.shading, way)) * leaves / (square * square);
    seen.all += weight[k];
  }
  const auto of = std::span(point).subspan(first, end - first);
  std::array<glm::dvec3, kAllLooks> passing;
  tinted_.passageTo(place, of, glm::dvec3(lamp.normal), key + first, passing);
  for (auto k = first; k < end; ++k) {
    const auto& passes = passing[k - first];
    if (passes == glm::dvec3(0.0)) continue;
    seen.part += weight[k];
    seen.light += weight[k] * passes;
  }
}

glm::dvec3 PlaceLight::fromSomeLamps(const Spot& spot, std::uint64_t key) const {
  const auto& place = spot.place;
  const auto from = LeafRays::startOf(place);
  const Sobol4 draws(key);
  glm::dvec3 sum(0.0);
  for (std::uint32_t k = 0; k < kDraws; ++k) {
    const auto at = draws(k);
    const auto drawn = many_->draw(from, glm::vec3(place.normal), at.x);
    if (drawn.light == scene::kNone) continue;
    const auto& lamp = many_->lights()[drawn.light];
    const glm::dvec3 point(lamp.point(at.y, at.z));
    const auto way = point - place.position;
    const double leaves = -glm::dot(glm::dvec3(lamp.normal), way), square = glm::dot(way, way);
    const double arrives = glm::dot(place.normal, way) > 0.0 ? glm::dot(spot.shading, way) : 0.0;
    if (!(arrives > 0.0 && leaves > 0.0)) continue;
    const auto passes = tinted_.passageTo(place, point, glm::dvec3(lamp.normal), mixKeys(key, k));
    sum += lamp.area * arrives * leaves / (std::numbers::pi * square * square * drawn.chance) * passes *
           glm::dvec3(lamp.emission);
  }
  return sum / static_cast<double>(kDraws);
}

}  // namespace radiosity::solver
