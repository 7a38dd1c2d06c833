#include "tests/oracle/path_tracer.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <map>
#include <numbers>
#include <optional>
#include <thread>
#include <utility>

#include "tests/oracle/burial.h"
#include "tests/oracle/directions.h"
#include "tests/oracle/lamps.h"
#include "tests/oracle/mirrors.h"
#include "tests/oracle/random.h"
#include "tests/oracle/ray_scene.h"
#include "tests/oracle/shading.h"

namespace radiosity::oracle {
namespace {

using std::numbers::pi;
constexpr std::uint32_t kBatches = 8;  // independent shifts: their spread is the standard error

struct Point {
  glm::dvec3 position, normal;
  std::uint32_t triangle = kNoTriangle;  ///< that it was chosen on
  glm::dvec3 shading = normal;           ///< unit; light is weighed by its cosine
};

glm::dvec3 uniformInTriangle(const std::array<glm::dvec3, 3>& c, double u, double v) {
  const double root = std::sqrt(u);
  return c[0] * (1.0 - root) + c[1] * (root * (1.0 - v)) + c[2] * (root * v);
}

double triangleArea(const std::array<glm::dvec3, 3>& c) {
  return 0.5 * glm::length(glm::cross(c[1] - c[0], c[2] - c[0]));
}

/// Picks an index by cumulative weight and turns u into a fresh uniform number.
std::size_t pick(const std::vector<double>& cumulative, double& u) {
  const double target = u * cumulative.back();
  const auto found = std::upper_bound(cumulative.begin(), cumulative.end() - 1, target);
  const auto index = static_cast<std::size_t>(found - cumulative.begin());
  const double low = index == 0 ? 0.0 : cumulative[index - 1];
  const double width = cumulative[index] - low;
  u = width > 0.0 ? std::clamp((target - low) / width, 0.0, 0x1.fffffffffffffp-1) : 0.5;
  return index;
}

struct Tally {
  glm::dvec3 sum{0.0};
  double visible = 0.0, tried = 0.0;
  double undecided = 0.0;          ///< of those tried, whether they are inside a solid
  double backs = 0.0, open = 0.0;  ///< of the first rays of those that are visible
};

}  // namespace

Footprint Footprint::at(const glm::dvec3& point, const glm::dvec3& normal) {
  return {{Piece{{point, point, point}, normal, kNoTriangle}}};
}

double Footprint::area() const {
  double sum = 0.0;
  for (const auto& piece : pieces) sum += triangleArea(piece.corners);
  return sum;
}

class PathTracer::Scene {
 public:
  explicit Scene(const TriangleScene& scene)
      : shading_(scene),
        rays_(triangles()),
        burial_(rays_, triangles()),
        twins_(flippedTwins(triangles())),
        lamps_(scene.lamps),
        sky_upper_(scene.sky_upper),
        sky_lower_(scene.sky_lower),
        sky_map_(scene.sky_map) {
    sky_map_.prepare();
    for (const auto& triangle : triangles()) {
      see_through_ = see_through_ || triangle.see_through;
      if (!(triangle.mirror.metallic > 0.0 || triangle.transmission > 0.0)) continue;
      has_mirrors_ = true;
      mirrors_.add(triangle.mirror.roughness);
    }
    gatherLights();
  }

  [[nodiscard]] Where whereIs(const Point& at) const { return burial_.whereIs(rays_.toUnit(at.position), at.normal); }

  [[nodiscard]] bool covered(const Point& point) const {
    return point.triangle != kNoTriangle &&
           burial_.underEarlier(rays_.toUnit(point.position), point.normal, point.triangle);
  }

  [[nodiscard]] Irradiance estimate(const Footprint& footprint, std::size_t index, const PathOptions& options) const {
    const auto cumulative = cumulativeAreas(footprint);
    const bool check_burial = options.leave_out_buried && mayBeBuried(footprint, cumulative, index, options.seed);
    std::array<Tally, kBatches> tallies;
    const auto per_batch = std::max<std::uint32_t>(1, (options.samples + kBatches - 1) / kBatches);
    for (std::uint32_t b = 0; b < kBatches; ++b) {
      Random random(Random::seedFrom(options.seed, index, b));
      const ShiftedLattice<7> lattice(random);
      for (std::uint32_t i = 0; i < per_batch; ++i) {
        const auto u = lattice.point(i);
        const auto point = pointOn(footprint, cumulative, u[0], u[1]);
        tallies[b].tried += 1.0;
        if (check_burial && leaveOut(point, tallies[b])) continue;
        if (see_through_ && onHole(point)) continue;
        tallies[b].visible += 1.0;
        tallies[b].sum += path(point, {u[2], u[3], u[4], u[5], u[6]}, random, tallies[b]);
      }
    }
    return summarize(tallies);
  }

  /// Whether the point is under an earlier face or inside a solid; counts it.
  [[nodiscard]] bool leaveOut(const Point& point, Tally& tally) const {
    if (covered(point)) return true;
    const auto where = whereIs(point);
    tally.undecided += isDecided(where) ? 0.0 : 1.0;
    return isInside(where);
  }

 private:
  using FirstVertex = std::array<double, 5>;  // three numbers for the light, two for the direction

  struct Hit {
    std::size_t triangle = 0;
    Point point;
    double distance = 0.0;
    bool back = false;
  };

  [[nodiscard]] const std::vector<Triangle>& triangles() const { return shading_.triangles(); }

  void gatherLights() {
    double sum = 0.0;
    light_density_.assign(triangles().size(), 0.0);
    for (std::size_t t = 0; t < triangles().size(); ++t) {
      const auto e = shading_.meanEmission(triangles()[t]);
      if (!(e.x + e.y + e.z > 0.0)) continue;
      sum += (e.x + e.y + e.z) * area(triangles()[t]);
      light_density_[t] = e.x + e.y + e.z;
      lights_.push_back(t);
      cumulative_power_.push_back(sum);
    }
    for (const auto t : lights_) light_density_[t] /= sum;  // probability per m^2
  }

  /// Origin lifted off its surface, so that a ray does not meet the surface it starts from.
  [[nodiscard]] glm::dvec3 lifted(const Point& point) const {
    return rays_.toUnit(point.position) + point.normal * kLift;
  }

  [[nodiscard]] std::optional<Hit> trace(const Point& from, const glm::dvec3& direction) const {
    return trace(from, direction, [](const RayScene::Met&) { return true; });
  }

  /// What it meets first of what `stops` it.
  template <typename Stops>
  [[nodiscard]] std::optional<Hit> trace(const Point& from, const glm::dvec3& direction, const Stops& stops) const {
    const auto met = rays_.first(lifted(from), direction, std::numeric_limits<double>::infinity(), stops);
    if (!met) return std::nullopt;
    Hit hit;
    hit.triangle = met->triangle;
    const auto& triangle = triangles()[hit.triangle];
    const double u = met->u, v = met->v;
    hit.point.position = triangle.corners[0] * (1.0 - u - v) + triangle.corners[1] * u + triangle.corners[2] * v;
    hit.back = glm::dot(direction, triangle.normal) >= 0.0;
    const bool other_side = hit.back && twins_[hit.triangle] != kNoTriangle;  // met by chance: both lie there
    hit.point.normal = hit.point.shading = hit.back ? -triangle.normal : triangle.normal;
    if (other_side) {
      hit.triangle = twins_[hit.triangle];
      hit.back = false;
    }
    hit.distance = glm::length(hit.point.position - from.position);
    return hit;
  }

  /// The nearest surface that stops the ray: each that it meets does so with the probability of its opacity there, also
  /// where several lie in one place. They may be asked in any order: the answer is the triangle's own.
  [[nodiscard]] std::optional<Hit> traceThrough(const Point& from, const glm::dvec3& direction, Random& random) const {
    const auto seed = random.next();
    return trace(from, direction, [&](const RayScene::Met& met) {
      const auto& triangle = triangles()[met.triangle];
      if (!triangle.see_through) return true;
      Random of_triangle(Random::seedFrom(seed, met.triangle, 0));
      return of_triangle.uniform() < shading_.opacity(triangle, met.u, met.v);
    });
  }

  [[nodiscard]] double opacityAt(const Triangle& triangle, const glm::dvec3& position) const {
    const auto [u, v] = Shading::weights(triangle, position);
    return shading_.opacity(triangle, u, v);
  }

  [[nodiscard]] glm::dvec3 emissionAt(const Triangle& triangle, const glm::dvec3& position) const {
    const auto [u, v] = Shading::weights(triangle, position);
    return shading_.emission(triangle, u, v);
  }

  [[nodiscard]] glm::dvec3 reflectanceAt(const Triangle& triangle, const glm::dvec3& position) const {
    const auto [u, v] = Shading::weights(triangle, position);
    return shading_.reflectance(triangle, u, v);
  }

  /// Of what leaves there the part that each bit of light contributes that arrives on the side where the path goes on.
  [[nodiscard]] glm::dvec3 scatteredAt(const Triangle& triangle, Point& at, Random& random) const {
    if (!(triangle.diffuse_transmission > 0.0)) return reflectanceAt(triangle, at.position);
    const auto [u, v] = Shading::weights(triangle, at.position);
    const auto [part, is_other_side] = shading_.scatter(triangle, u, v, random.uniform());
    if (is_other_side) at.normal = -at.normal, at.shading = -at.shading;
    return part;
  }

  /// Whether the point lies where its own surface is cut out.
  [[nodiscard]] bool onHole(const Point& point) const {
    const Point above{point.position + point.normal * (4.0 * kLift / rays_.scale()), -point.normal};
    const auto hit = trace(above, -point.normal);
    return hit && opacityAt(triangles()[hit->triangle], hit->point.position) <= 0.0;
  }

  [[nodiscard]] bool sees(const Point& a, const Point& b, Random& random) const {
    const auto way = b.position - a.position;
    const double distance = glm::length(way);
    if (see_through_) {
      const auto hit = traceThrough(a, way / distance, random);
      return !hit || hit->distance >= distance - 4.0 * kLift / rays_.scale();
    }
    return !rays_.blocked(lifted(a), lifted(b) - lifted(a));
  }

  /// From a point to where a lamp is, or to infinity.
  [[nodiscard]] bool seesLamp(const Point& a, const glm::dvec3& direction, double distance, Random& random) const {
    if (see_through_) {
      const auto hit = traceThrough(a, direction, random);
      return !hit || hit->distance >= distance;
    }
    return !rays_.blocked(lifted(a),
                          std::isfinite(distance) ? direction * (distance * rays_.scale()) : direction * 10.0);
  }

  [[nodiscard]] glm::dvec3 lampLight(const Point& at, Random& random) const {
    glm::dvec3 sum(0.0);
    for (const auto& lamp : lamps_) {
      const bool has_size = lamp.radius > 0.0 || lamp.kind == Lamp::Kind::kRectangle;
      const double u = has_size ? random.uniform() : 0.0, v = has_size ? random.uniform() : 0.0;
      const auto light = lightOf(lamp, at.position, at.shading, u, v);
      if (light.irradiance == glm::dvec3(0.0) || glm::dot(light.direction, at.normal) <= 0.0) continue;
      if (seesLamp(at, light.direction, light.distance, random)) sum += light.irradiance;
    }
    return sum;
  }

  /// Light straight from a random point of an emitter, weighted against meeting it by a cosine ray (balance heuristic,
  /// Veach and Guibas 1995).
  [[nodiscard]] glm::dvec3 direct(const Point& at, double u0, double u1, double u2, Random& random) const {
    if (lights_.empty()) return glm::dvec3(0.0);
    const auto t = lights_[pick(cumulative_power_, u0)];
    const auto& light = triangles()[t];
    Point y{uniformInTriangle(light.corners, u1, u2), light.normal};
    const auto way = y.position - at.position;
    const double distance2 = glm::dot(way, way);
    if (!(distance2 > 0.0)) return glm::dvec3(0.0);
    const auto direction = way / std::sqrt(distance2);
    const double cos_at = glm::dot(direction, at.normal) > 0.0 ? glm::dot(direction, at.shading) : 0.0;
    double cos_light = -glm::dot(direction, light.normal);
    if (cos_light < 0.0 && hasTwoSides(light)) {
      cos_light = -cos_light;
      y.normal = -y.normal;
    }
    if (cos_at <= 0.0 || cos_light <= 0.0) return glm::dvec3(0.0);
    if (!sees(at, y, random)) return glm::dvec3(0.0);
    const double density = light_density_[t] * distance2 / cos_light;  // per steradian
    const double there = opacityAt(light, y.position);
    return emissionAt(light, y.position) * (there * cos_at / pi / (density + cos_at / pi));
  }

  /// The picture of the sky in a direction drawn by its light, weighted against meeting it by a cosine ray.
  [[nodiscard]] glm::dvec3 mapLight(const Point& at, Random& random) const {
    const double u = random.uniform(), v = random.uniform();
    const auto direction = sky_map_.draw(u, v);
    const double cosine = glm::dot(direction, at.normal) > 0.0 ? glm::dot(direction, at.shading) : 0.0;
    const double density = sky_map_.density(direction);
    if (cosine <= 0.0 || density <= 0.0) return glm::dvec3(0.0);
    if (!seesLamp(at, direction, std::numeric_limits<double>::infinity(), random)) return glm::dvec3(0.0);
    return sky_map_.radiance(direction) * (cosine / (density + cosine / pi));
  }

  /// The other part of that: what a cosine ray that leaves the scene finds.
  [[nodiscard]] glm::dvec3 mapByCosine(const Point& at, const glm::dvec3& direction) const {
    if (sky_map_.empty()) return glm::dvec3(0.0);
    const double cosine = std::max(1e-12, glm::dot(direction, at.shading));
    return sky_map_.radiance(direction) * (cosine / (sky_map_.density(direction) + cosine / pi));
  }

  /// One sample of irradiance: H(x) = direct + mean over cosine directions of rho(y) H(y).
  [[nodiscard]] glm::dvec3 path(Point at, const FirstVertex& first, Random& random, Tally& tally) const {
    glm::dvec3 sum(0.0);
    glm::dvec3 throughput(1.0);
    for (int bounce = 0;; ++bounce) {
      FirstVertex u = first;
      if (bounce > 0) std::generate(u.begin(), u.end(), [&] { return random.uniform(); });
      sum += throughput * (direct(at, u[0], u[1], u[2], random) + lampLight(at, random));
      if (!sky_map_.empty()) sum += throughput * mapLight(at, random);
      const auto direction = cosineDirection(at.shading, u[3], u[4]);
      if (glm::dot(direction, at.normal) <= 0.0) return sum;  // into the surface itself
      auto hit = see_through_ ? traceThrough(at, direction, random) : trace(at, direction);
      if (bounce == 0) count(hit, tally);
      // The colours of the sky are met by cosine rays only: pi times their radiance is the mean over them.
      if (!hit)
        return sum + throughput * (pi * (direction.y > 0.0 ? sky_upper_ : sky_lower_) + mapByCosine(at, direction));
      if (isBlackBack(*hit)) return sum;
      sum += throughput * metByCosine(at, direction, *hit);
      if (has_mirrors_) {
        const auto sent = throughput;
        sum += sent * alongMirrors(direction, hit, throughput, random);
        if (!hit) return sum;
      }
      at = hit->point;
      throughput *= scatteredAt(triangles()[hit->triangle], at, random);
      const double survival = std::min(1.0, std::max({throughput.x, throughput.y, throughput.z}));
      if (survival <= 0.0) return sum;
      if (bounce >= 1) {
        if (random.uniform() >= survival) return sum;
        throughput /= survival;
      }
    }
  }

  /// Goes on from what a ray met for as long as mirrors reflect it, or glass lets it through: then `hit` is what
  /// scatters it, or none, and `throughput` is less by what was lost on the way. Returns what shines there, of one unit
  /// of what `throughput` was.
  [[nodiscard]] glm::dvec3 alongMirrors(glm::dvec3 direction, std::optional<Hit>& hit, glm::dvec3& throughput,
                                        Random& random) const {
    constexpr int kMostHops = 64;
    glm::dvec3 part(1.0), sum(0.0);
    for (int hop = 0; hop < kMostHops; ++hop) {
      const auto& triangle = triangles()[hit->triangle];
      const Mirrors::Place place{hit->point.position, hit->point.normal, hit->back};
      auto way = mirrors_.goOn(shading_, triangle, place, direction, part, random);
      if (!way) {
        throughput *= part;
        return sum;
      }
      direction = *way;
      const Point from{hit->point.position,
                       glm::dot(direction, hit->point.normal) > 0.0 ? hit->point.normal : -hit->point.normal};
      hit = see_through_ ? traceThrough(from, direction, random) : trace(from, direction);
      if (!hit) {
        sum += part * pi * (direction.y > 0.0 ? sky_upper_ : sky_lower_);
        if (!sky_map_.empty()) sum += part * pi * sky_map_.radiance(direction);
        return sum;
      }
      if (isBlackBack(*hit)) break;
      sum += part * emissionAt(triangles()[hit->triangle], hit->point.position);
    }
    hit.reset();
    return sum;
  }

  [[nodiscard]] bool isBlackBack(const Hit& hit) const {
    const auto& triangle = triangles()[hit.triangle];
    return hit.back && !hasTwoSides(triangle) && triangle.transmission <= 0.0;
  }

  void count(const std::optional<Hit>& first, Tally& tally) const {
    tally.open += first ? 0.0 : 1.0;
    tally.backs += first && isBlackBack(*first) ? 1.0 : 0.0;
  }

  /// What a cosine ray meets shines by the other part of the balance heuristic (`direct`).
  [[nodiscard]] glm::dvec3 metByCosine(const Point& at, const glm::dvec3& direction, const Hit& hit) const {
    if (light_density_[hit.triangle] <= 0.0) return glm::dvec3(0.0);
    const double by_cosine = glm::dot(direction, at.shading) / pi;
    const double cos_light = std::max(1e-12, -glm::dot(direction, hit.point.normal));
    const double by_light = light_density_[hit.triangle] * hit.distance * hit.distance / cos_light;
    return emissionAt(triangles()[hit.triangle], hit.point.position) * (by_cosine / (by_cosine + by_light));
  }

  [[nodiscard]] static std::vector<double> cumulativeAreas(const Footprint& footprint) {
    std::vector<double> cumulative;
    double sum = 0.0;
    for (const auto& piece : footprint.pieces) cumulative.push_back(sum += triangleArea(piece.corners));
    if (!(sum > 0.0)) {  // points: all alike
      for (std::size_t i = 0; i < cumulative.size(); ++i) cumulative[i] = static_cast<double>(i + 1);
    }
    return cumulative;
  }

  [[nodiscard]] static Point pointOn(const Footprint& footprint, const std::vector<double>& cumulative, double u,
                                     double v) {
    const auto& piece = footprint.pieces[pick(cumulative, u)];
    auto shading = uniformInTriangle(piece.shading, u, v);
    const double length = glm::length(shading);
    shading = length > 1e-6 ? shading / length : piece.normal;
    if (!(glm::dot(shading, piece.normal) > 0.0)) shading = piece.normal;
    return {uniformInTriangle(piece.corners, u, v), piece.normal, piece.triangle, shading};
  }

  /// Cheap first look: no footprint from which no ray leaves a solid needs the test at every sample.
  [[nodiscard]] bool mayBeBuried(const Footprint& footprint, const std::vector<double>& cumulative, std::size_t index,
                                 std::uint64_t seed) const {
    Random random(Random::seedFrom(seed, index, kBatches));
    const ShiftedLattice<4> lattice(random);
    for (std::uint32_t i = 0; i < 128; ++i) {
      const auto u = lattice.point(i);
      const auto point = pointOn(footprint, cumulative, u[0], u[1]);
      const auto place = lifted(point);
      if (covered(point) || burial_.leavesSolid(place, cosineDirection(point.normal, u[2], u[3]))) return true;
    }
    return false;
  }

  [[nodiscard]] static Irradiance summarize(const std::array<Tally, kBatches>& tallies) {
    Tally all;
    for (const auto& tally : tallies) {
      all.sum += tally.sum;
      all.visible += tally.visible;
      all.tried += tally.tried;
      all.undecided += tally.undecided;
      all.backs += tally.backs;
      all.open += tally.open;
    }
    Irradiance result;
    result.visible_fraction = all.tried > 0.0 ? all.visible / all.tried : 0.0;
    result.undecided_fraction = all.tried > 0.0 ? all.undecided / all.tried : 0.0;
    if (all.visible <= 0.0) return result;
    result.mean_lux = all.sum / all.visible;
    result.back_fraction = all.backs / all.visible;
    result.open_fraction = all.open / all.visible;
    glm::dvec3 variance(0.0);  // of the ratio of sums, batch by batch
    for (const auto& tally : tallies) {
      const auto residual = (tally.sum - result.mean_lux * tally.visible) * (kBatches / all.visible);
      variance += residual * residual;
    }
    result.standard_error = glm::sqrt(variance / (kBatches * (kBatches - 1.0)));
    return result;
  }

  static constexpr double kLift = 2e-6;  // of a box of size 2

  Shading shading_;
  RayScene rays_;
  Burial burial_;
  std::vector<std::uint32_t> twins_;  // by triangle: what shows its front where this one turns its back
  std::vector<Lamp> lamps_;
  glm::dvec3 sky_upper_, sky_lower_;
  SkyMap sky_map_;
  bool see_through_ = false, has_mirrors_ = false;  // anything
  Mirrors mirrors_;
  std::vector<std::size_t> lights_;
  std::vector<double> cumulative_power_;
  std::vector<double> light_density_;  // by triangle; 0: does not shine
};

PathTracer::PathTracer(const TriangleScene& scene) : scene_(std::make_unique<Scene>(scene)) {}
PathTracer::~PathTracer() = default;

std::vector<Irradiance> PathTracer::irradiance(std::span<const Footprint> footprints,
                                               const PathOptions& options) const {
  std::vector<Irradiance> results(footprints.size());
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (auto i = next++; i < footprints.size(); i = next++) {
      if (!footprints[i].pieces.empty()) results[i] = scene_->estimate(footprints[i], i, options);
    }
  };
  const auto wanted = options.threads > 0 ? options.threads : std::max(1U, std::thread::hardware_concurrency());
  std::vector<std::thread> threads;
  for (unsigned i = 1; i < wanted; ++i) threads.emplace_back(work);
  work();
  for (auto& thread : threads) thread.join();
  return results;
}

bool PathTracer::buried(const glm::dvec3& point, const glm::dvec3& normal) const {
  return isInside(scene_->whereIs({point, normal, kNoTriangle}));
}

}  // namespace radiosity::oracle
