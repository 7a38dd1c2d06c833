#include "tests/oracle/path_tracer.h"

#include <embree3/rtcore.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>
#include <optional>
#include <stdexcept>
#include <thread>
#include <utility>

#include "tests/oracle/burial.h"
#include "tests/oracle/directions.h"
#include "tests/oracle/embree_ray.h"
#include "tests/oracle/lamps.h"
#include "tests/oracle/random.h"

namespace radiosity::oracle {
namespace {

constexpr double kPi = std::numbers::pi;
constexpr std::uint32_t kBatches = 8;  // independent shifts: their spread is the standard error

struct Point {
  glm::dvec3 position, normal;
  std::uint32_t triangle = kNoTriangle;  ///< that it was chosen on
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
  double front = 0.0, covered = 0.0;  ///< of those tried, on fronts, and of these under an earlier face
  double undecided = 0.0;             ///< of those tried, whether they are inside a solid
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
      : triangles_(scene.triangles),
        textures_(scene.textures),
        lamps_(scene.lamps),
        sky_upper_(scene.sky_upper),
        sky_lower_(scene.sky_lower) {
    for (const auto& triangle : triangles_) see_through_ = see_through_ || triangle.see_through;
    device_ = rtcNewDevice(nullptr);
    if (device_ == nullptr) throw std::runtime_error("Embree did not start");
    measure();
    build();
    gatherLights();
  }
  ~Scene() {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;

  [[nodiscard]] Where whereIs(const Point& at) const { return burial_->whereIs(toUnit(at.position), at.normal); }

  [[nodiscard]] bool covered(const Point& point) const {
    return point.triangle != kNoTriangle && burial_->underEarlier(toUnit(point.position), point.normal, point.triangle);
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
        tallies[b].sum += path(point, {u[2], u[3], u[4], u[5], u[6]}, random);
      }
    }
    return summarize(tallies);
  }

  /// Whether the point is under an earlier face or inside a solid; counts it.
  [[nodiscard]] bool leaveOut(const Point& point, Tally& tally) const {
    const bool under = covered(point);
    const bool is_front =
        point.triangle != kNoTriangle && glm::dot(triangles_[point.triangle].normal, point.normal) > 0;
    tally.front += is_front ? 1.0 : 0.0;
    tally.covered += is_front && under ? 1.0 : 0.0;
    if (under) return true;
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

  void measure() {
    glm::dvec3 low(std::numeric_limits<double>::infinity());
    glm::dvec3 high(-low);
    for (const auto& triangle : triangles_) {
      for (const auto& corner : triangle.corners) {
        low = glm::min(low, corner);
        high = glm::max(high, corner);
      }
    }
    centre_ = 0.5 * (low + high);
    const auto size = high - low;
    // Everything is traced in a box of size 2: Embree works in float.
    scale_ = triangles_.empty() ? 1.0 : 2.0 / std::max({size.x, size.y, size.z});
  }

  [[nodiscard]] glm::dvec3 toUnit(const glm::dvec3& world) const { return (world - centre_) * scale_; }

  void build() {
    scene_ = rtcNewScene(device_);
    rtcSetSceneFlags(scene_,
                     static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION));
    rtcSetSceneBuildQuality(scene_, RTC_BUILD_QUALITY_HIGH);
    if (!triangles_.empty()) {
      const RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
      auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(
          geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 3 * sizeof(float), triangles_.size() * 3));
      auto* indices = static_cast<unsigned*>(rtcSetNewGeometryBuffer(
          geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(unsigned), triangles_.size()));
      for (std::size_t t = 0; t < triangles_.size(); ++t) {
        for (std::size_t k = 0; k < 3; ++k) {
          const auto position = toUnit(triangles_[t].corners[k]);
          for (int axis = 0; axis < 3; ++axis) *vertices++ = static_cast<float>(position[axis]);
          *indices++ = static_cast<unsigned>(3 * t + k);
        }
      }
      rtcCommitGeometry(geometry);
      rtcAttachGeometry(scene_, geometry);
      rtcReleaseGeometry(geometry);
    }
    rtcCommitScene(scene_);
    burial_.emplace(scene_, triangles_);
  }

  void gatherLights() {
    double sum = 0.0;
    light_density_.assign(triangles_.size(), 0.0);
    for (std::size_t t = 0; t < triangles_.size(); ++t) {
      const auto& e = triangles_[t].emission_lux;
      if (!(e.x + e.y + e.z > 0.0)) continue;
      sum += (e.x + e.y + e.z) * area(triangles_[t]);
      lights_.push_back(t);
      cumulative_power_.push_back(sum);
    }
    for (const auto t : lights_) {
      const auto& e = triangles_[t].emission_lux;
      light_density_[t] = (e.x + e.y + e.z) / sum;  // probability per m^2
    }
  }

  /// Origin lifted off its surface, so that a ray does not meet the surface it starts from.
  [[nodiscard]] glm::dvec3 lifted(const Point& point) const { return toUnit(point.position) + point.normal * kLift; }

  [[nodiscard]] std::optional<Hit> trace(const Point& from, const glm::dvec3& direction) const {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    return trace(from, direction, context);
  }

  [[nodiscard]] std::optional<Hit> trace(const Point& from, const glm::dvec3& direction,
                                         RTCIntersectContext& context) const {
    auto query = embreeRay(lifted(from), direction, std::numeric_limits<double>::infinity());
    rtcIntersect1(scene_, &context, &query);
    if (query.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::nullopt;
    Hit hit;
    hit.triangle = query.hit.primID;
    const auto& triangle = triangles_[hit.triangle];
    const double u = query.hit.u;
    const double v = query.hit.v;
    hit.point.position = triangle.corners[0] * (1.0 - u - v) + triangle.corners[1] * u + triangle.corners[2] * v;
    hit.back = glm::dot(direction, triangle.normal) >= 0.0;
    hit.point.normal = hit.back ? -triangle.normal : triangle.normal;
    hit.distance = glm::length(hit.point.position - from.position);
    return hit;
  }

  /// Embree hands the context to the filter.
  struct Passing {
    RTCIntersectContext context;
    const Scene* scene;
    std::uint64_t seed;
  };

  /// What it meets lets the ray through with the probability of its transmittance there. Embree may ask for a triangle
  /// more than once, in any order: the answer is the triangle's own.
  static void letThrough(const RTCFilterFunctionNArguments* arguments) {
    const auto& passing = *reinterpret_cast<const Passing*>(arguments->context);
    for (unsigned i = 0; i < arguments->N; ++i) {
      if (arguments->valid[i] != -1) continue;
      const auto t = RTCHitN_primID(arguments->hit, arguments->N, i);
      const auto& triangle = passing.scene->triangles_[t];
      if (!triangle.see_through) continue;
      const auto u = static_cast<double>(RTCHitN_u(arguments->hit, arguments->N, i));
      const auto v = static_cast<double>(RTCHitN_v(arguments->hit, arguments->N, i));
      Random random(Random::seedFrom(passing.seed, t, 0));
      if (random.uniform() >= passing.scene->opacityAt(triangle, u, v)) arguments->valid[i] = 0;
    }
  }

  /// The nearest surface that stops the ray: each that it meets does so with the probability of its opacity there, also
  /// where several lie in one place.
  [[nodiscard]] std::optional<Hit> traceThrough(const Point& from, const glm::dvec3& direction, Random& random) const {
    Passing passing{{}, this, random.next()};
    rtcInitIntersectContext(&passing.context);
    passing.context.filter = &Scene::letThrough;
    return trace(from, direction, passing.context);
  }

  [[nodiscard]] double opacityAt(const Triangle& triangle, const glm::dvec3& position) const {
    const auto [u, v] = weightsAt(triangle, position);
    return opacityAt(triangle, u, v);
  }

  /// (u, v): weights of its second and third corner.
  [[nodiscard]] double opacityAt(const Triangle& triangle, double u, double v) const {
    if (!triangle.see_through) return 1.0;
    double alpha = triangle.alpha * textureAt(triangle, u, v).w;
    if (triangle.cutoff >= 0.0) alpha = alpha >= triangle.cutoff ? 1.0 : 0.0;
    return alpha * (1.0 - triangle.transmission);
  }

  [[nodiscard]] static std::pair<double, double> weightsAt(const Triangle& triangle, const glm::dvec3& position) {
    const auto& [a, b, c] = triangle.corners;
    const auto normal = glm::cross(b - a, c - a);
    const double square = glm::dot(normal, normal);
    return {glm::dot(glm::cross(position - a, c - a), normal) / square,
            glm::dot(glm::cross(b - a, position - a), normal) / square};
  }

  [[nodiscard]] glm::dvec4 textureAt(const Triangle& triangle, const glm::dvec3& position) const {
    const auto [u, v] = weightsAt(triangle, position);
    return textureAt(triangle, u, v);
  }

  [[nodiscard]] glm::dvec4 textureAt(const Triangle& triangle, double u, double v) const {
    if (triangle.texture < 0) return glm::dvec4(1.0);
    const auto& uv = triangle.texture_uv;
    return textures_[static_cast<std::size_t>(triangle.texture)].at(uv[0] * (1.0 - u - v) + uv[1] * u + uv[2] * v);
  }

  /// Whether the point lies where its own surface is cut out.
  [[nodiscard]] bool onHole(const Point& point) const {
    const Point above{point.position + point.normal * (4.0 * kLift / scale_), -point.normal};
    const auto hit = trace(above, -point.normal);
    return hit && opacityAt(triangles_[hit->triangle], hit->point.position) <= 0.0;
  }

  [[nodiscard]] bool sees(const Point& a, const Point& b, Random& random) const {
    const auto way = b.position - a.position;
    const double distance = glm::length(way);
    if (see_through_) {
      const auto hit = traceThrough(a, way / distance, random);
      return !hit || hit->distance >= distance - 4.0 * kLift / scale_;
    }
    return !blocked(lifted(a), lifted(b) - lifted(a));
  }

  /// From a point to where a lamp is, or to infinity.
  [[nodiscard]] bool seesLamp(const Point& a, const glm::dvec3& direction, double distance, Random& random) const {
    if (see_through_) {
      const auto hit = traceThrough(a, direction, random);
      return !hit || hit->distance >= distance;
    }
    return !blocked(lifted(a), std::isfinite(distance) ? direction * (distance * scale_) : direction * 10.0);
  }

  [[nodiscard]] glm::dvec3 lampLight(const Point& at, Random& random) const {
    glm::dvec3 sum(0.0);
    for (const auto& lamp : lamps_) {
      const auto light = lightOf(lamp, at.position, at.normal);
      if (light.irradiance == glm::dvec3(0.0)) continue;
      if (seesLamp(at, light.direction, light.distance, random)) sum += light.irradiance;
    }
    return sum;
  }

  [[nodiscard]] bool blocked(const glm::dvec3& from, const glm::dvec3& way) const {
    RTCRay ray{};
    ray.org_x = static_cast<float>(from.x);
    ray.org_y = static_cast<float>(from.y);
    ray.org_z = static_cast<float>(from.z);
    ray.dir_x = static_cast<float>(way.x);
    ray.dir_y = static_cast<float>(way.y);
    ray.dir_z = static_cast<float>(way.z);
    ray.tfar = 1.0F;
    ray.mask = ~0U;
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    rtcOccluded1(scene_, &context, &ray);
    return ray.tfar <= 0.0F;
  }

  /// Light straight from a random point of an emitter, weighted against meeting it by a cosine ray (balance heuristic,
  /// Veach and Guibas 1995).
  [[nodiscard]] glm::dvec3 direct(const Point& at, double u0, double u1, double u2, Random& random) const {
    if (lights_.empty()) return glm::dvec3(0.0);
    const auto t = lights_[pick(cumulative_power_, u0)];
    const auto& light = triangles_[t];
    Point y{uniformInTriangle(light.corners, u1, u2), light.normal};
    const auto way = y.position - at.position;
    const double distance2 = glm::dot(way, way);
    if (!(distance2 > 0.0)) return glm::dvec3(0.0);
    const auto direction = way / std::sqrt(distance2);
    const double cos_at = glm::dot(direction, at.normal);
    double cos_light = -glm::dot(direction, light.normal);
    if (cos_light < 0.0 && light.double_sided) {
      cos_light = -cos_light;
      y.normal = -y.normal;
    }
    if (cos_at <= 0.0 || cos_light <= 0.0) return glm::dvec3(0.0);
    if (!sees(at, y, random)) return glm::dvec3(0.0);
    const double density = light_density_[t] * distance2 / cos_light;  // per steradian
    const double there = opacityAt(light, y.position);
    return light.emission_lux * (there * cos_at / kPi / (density + cos_at / kPi));
  }

  /// One sample of irradiance: H(x) = direct + mean over cosine directions of rho(y) H(y).
  [[nodiscard]] glm::dvec3 path(Point at, const FirstVertex& first, Random& random) const {
    glm::dvec3 sum(0.0);
    glm::dvec3 throughput(1.0);
    for (int bounce = 0;; ++bounce) {
      FirstVertex u = first;
      if (bounce > 0) std::generate(u.begin(), u.end(), [&] { return random.uniform(); });
      sum += throughput * (direct(at, u[0], u[1], u[2], random) + lampLight(at, random));
      const auto direction = cosineDirection(at.normal, u[3], u[4]);
      const auto hit = see_through_ ? traceThrough(at, direction, random) : trace(at, direction);
      // The sky is met by cosine rays only: pi times its radiance is the mean over them.
      if (!hit) return sum + throughput * kPi * (direction.y > 0.0 ? sky_upper_ : sky_lower_);
      const auto& triangle = triangles_[hit->triangle];
      if (hit->back && !triangle.double_sided) return sum;
      if (light_density_[hit->triangle] > 0.0) {
        const double by_cosine = glm::dot(direction, at.normal) / kPi;
        const double cos_light = std::max(1e-12, -glm::dot(direction, hit->point.normal));
        const double by_light = light_density_[hit->triangle] * hit->distance * hit->distance / cos_light;
        sum += throughput * triangle.emission_lux * (by_cosine / (by_cosine + by_light));
      }
      throughput *= triangle.reflectance;
      if (triangle.texture >= 0) throughput *= glm::dvec3(textureAt(triangle, hit->point.position));
      const double survival = std::min(1.0, std::max({throughput.x, throughput.y, throughput.z}));
      if (survival <= 0.0) return sum;
      if (bounce >= 1) {
        if (random.uniform() >= survival) return sum;
        throughput /= survival;
      }
      at = hit->point;
    }
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
    return {uniformInTriangle(piece.corners, u, v), piece.normal, piece.triangle};
  }

  /// Cheap first look: no footprint from which no ray leaves a solid needs the test at every sample.
  [[nodiscard]] bool mayBeBuried(const Footprint& footprint, const std::vector<double>& cumulative, std::size_t index,
                                 std::uint64_t seed) const {
    Random random(Random::seedFrom(seed, index, kBatches));
    const ShiftedLattice<4> lattice(random);
    for (std::uint32_t i = 0; i < 128; ++i) {
      const auto u = lattice.point(i);
      const auto point = pointOn(footprint, cumulative, u[0], u[1]);
      const auto place = toUnit(point.position) + point.normal * kLift;
      if (covered(point) || burial_->leavesSolid(place, cosineDirection(point.normal, u[2], u[3]))) return true;
    }
    return false;
  }

  [[nodiscard]] static Irradiance summarize(const std::array<Tally, kBatches>& tallies) {
    Tally all;
    for (const auto& tally : tallies) {
      all.sum += tally.sum;
      all.visible += tally.visible;
      all.tried += tally.tried;
      all.front += tally.front;
      all.covered += tally.covered;
      all.undecided += tally.undecided;
    }
    // A lightmap shows there what the earlier face receives, also where the back of this one is seen. One in some ten
    // thousand points lies so near an edge that rounding puts it beside the earlier face.
    if (all.covered > 0.0 && all.covered >= kAllCovered * all.front) all.visible = 0.0;
    Irradiance result;
    result.visible_fraction = all.tried > 0.0 ? all.visible / all.tried : 0.0;
    result.undecided_fraction = all.tried > 0.0 ? all.undecided / all.tried : 0.0;
    if (all.visible <= 0.0) return result;
    result.mean_lux = all.sum / all.visible;
    glm::dvec3 variance(0.0);  // of the ratio of sums, batch by batch
    for (const auto& tally : tallies) {
      const auto residual = (tally.sum - result.mean_lux * tally.visible) * (kBatches / all.visible);
      variance += residual * residual;
    }
    result.standard_error = glm::sqrt(variance / (kBatches * (kBatches - 1.0)));
    return result;
  }

  static constexpr double kLift = 2e-6;  // of a box of size 2
  static constexpr double kAllCovered = 0.999;

  std::vector<Triangle> triangles_;
  std::vector<Texture> textures_;
  std::vector<Lamp> lamps_;
  glm::dvec3 sky_upper_, sky_lower_;
  bool see_through_ = false;  // anything
  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
  std::optional<Burial> burial_;
  glm::dvec3 centre_{0.0};
  double scale_ = 1.0;
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
