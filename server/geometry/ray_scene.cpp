#include "server/geometry/ray_scene.h"

#include <embree3/rtcore.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

#include "server/geometry/same_triangles.h"

namespace radiosity::geometry {
namespace {

/// Hits no farther apart coincide: what rounding makes of one place on two triangles.
constexpr float kSame = 1e-6F;
/// By which triangles grow in their planes.
constexpr float kGrown = 5e-7F;
/// A corner of less than so many radians grows as one of so many: a needle shall not become longer.
constexpr float kSharpest = 0.5F;
/// Processors of 256 and of 512 bits run the same code, and give the same bits.
constexpr const char* kInstructions = "isa=avx2";

struct DeviceDeleter {
  void operator()(RTCDevice device) const { rtcReleaseDevice(device); }
};
struct SceneDeleter {
  void operator()(RTCScene scene) const { rtcReleaseScene(scene); }
};
using Device = std::unique_ptr<RTCDeviceTy, DeviceDeleter>;
using Scene = std::unique_ptr<RTCSceneTy, SceneDeleter>;

/// Which triangles stand in the tree.
struct Numbers {
  /// By geometry, what its triangles are numbered; empty: as they are.
  std::array<std::vector<std::uint32_t>, 2> triangle_of;
  /// By triangle, the next one with the same corners, which is not in the tree, or kNoTriangle. Empty: there are none.
  std::vector<std::uint32_t> next_same;

  [[nodiscard]] std::uint32_t of(std::uint32_t geometry, std::uint32_t primitive) const {
    return triangle_of[geometry].empty() ? primitive : triangle_of[geometry][primitive];
  }
  [[nodiscard]] std::uint32_t after(std::uint32_t triangle) const {
    return next_same.empty() ? kNoTriangle : next_same[triangle];
  }
};

/// What the rays of one question go by, and what they met so far. Embree hands it to the filters below.
struct Nearest {
  RTCIntersectContext context;  // first: Embree's pointer to it is a pointer to this
  const Numbers* numbers = nullptr;
  std::array<std::uint32_t, kPacket> own;
  std::span<const std::uint32_t> passed;
  std::array<Hit, kPacket> hit;
};

struct Open {
  RTCIntersectContext context;  // first, as above
  const Numbers* numbers = nullptr;
  const SeeThrough* passes = nullptr;
  const std::uint64_t* key = nullptr;
};

/// Takes a hit that is nearer than the one before, or coincides with that and goes before it; and has Embree look on
/// for what coincides with it.
void takeNearest(const RTCFilterFunctionNArguments* arguments) {
  auto& asked = *reinterpret_cast<Nearest*>(arguments->context);
  const auto count = arguments->N;
  for (unsigned lane = 0; lane < count; ++lane) {
    if (arguments->valid[lane] != -1) continue;
    const auto ray = RTCRayN_id(arguments->ray, count, lane);
    auto triangle =
        asked.numbers->of(RTCHitN_geomID(arguments->hit, count, lane), RTCHitN_primID(arguments->hit, count, lane));
    float& far = RTCRayN_tfar(arguments->ray, count, lane);
    const float t = far;
    auto& best = asked.hit[ray];
    const auto isPassed = [&] {
      return triangle == asked.own[ray] || std::ranges::find(asked.passed, triangle) != asked.passed.end();
    };
    for (auto next = asked.numbers->after(triangle); next != kNoTriangle && isPassed();
         next = asked.numbers->after(triangle))
      triangle = next;
    const bool front = RTCHitN_Ng_x(arguments->hit, count, lane) * RTCRayN_dir_x(arguments->ray, count, lane) +
                           RTCHitN_Ng_y(arguments->hit, count, lane) * RTCRayN_dir_y(arguments->ray, count, lane) +
                           RTCHitN_Ng_z(arguments->hit, count, lane) * RTCRayN_dir_z(arguments->ray, count, lane) <
                       0.0F;
    const bool ties = best.found() && std::abs(t - best.t) <= kSame;
    const bool wins = ties ? (front != best.front ? front : triangle < best.triangle) : !best.found() || t < best.t;
    if (!wins || isPassed()) {
      arguments->valid[lane] = 0;
      continue;
    }
    best = {t, triangle, front};
    far = t + kSame;
  }
}

RTCRay queryOf(const Ray& ray) {
  RTCRay query{};
  query.org_x = ray.origin.x;
  query.org_y = ray.origin.y;
  query.org_z = ray.origin.z;
  query.dir_x = ray.direction.x;
  query.dir_y = ray.direction.y;
  query.dir_z = ray.direction.z;
  query.tfar = ray.reach;
  query.mask = ~0U;
  return query;
}

/// A way without a key passes all that one can see through.
void passThrough(const RTCFilterFunctionNArguments* arguments) {
  const auto& asked = *reinterpret_cast<const Open*>(arguments->context);
  const auto count = arguments->N;
  for (unsigned lane = 0; lane < count; ++lane) {
    if (arguments->valid[lane] != -1) continue;
    auto triangle =
        asked.numbers->of(RTCHitN_geomID(arguments->hit, count, lane), RTCHitN_primID(arguments->hit, count, lane));
    const float u = RTCHitN_u(arguments->hit, count, lane), v = RTCHitN_v(arguments->hit, count, lane);
    const glm::vec3 direction(RTCRayN_dir_x(arguments->ray, count, lane), RTCRayN_dir_y(arguments->ray, count, lane),
                              RTCRayN_dir_z(arguments->ray, count, lane));
    bool passes = true;
    for (; asked.key != nullptr && passes && triangle != kNoTriangle; triangle = asked.numbers->after(triangle))
      passes = asked.passes->passes(triangle, u, v, direction, asked.key[RTCRayN_id(arguments->ray, count, lane)]);
    if (passes) arguments->valid[lane] = 0;
  }
}

/// Each edge moves outwards by kGrown. What has no area stays as it is.
Triangle grown(const Triangle& triangle) {
  Triangle larger = triangle;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto to_next = triangle[(k + 1) % 3] - triangle[k], to_last = triangle[(k + 2) % 3] - triangle[k];
    const float next = glm::length(to_next), last = glm::length(to_last);
    if (!(next > 0.0F && last > 0.0F)) return triangle;
    const auto a = to_next / next, b = to_last / last;
    const float sine = std::max(glm::length(glm::cross(a, b)), kSharpest);
    larger[k] -= kGrown / sine * (a + b);
  }
  return larger;
}

/// Triangles of one kind, by their numbers; all of them, where `numbers` is empty.
bool attach(RTCDevice device, RTCScene scene, std::span<const Triangle> triangles,
            std::span<const std::uint32_t> numbers, std::size_t count, bool see_through) {
  const RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* corners = static_cast<glm::vec3*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(glm::vec3), 3 * count));
  auto* indices = static_cast<std::uint32_t*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 3 * sizeof(std::uint32_t), count));
  const bool room = corners != nullptr && indices != nullptr;
  for (std::size_t i = 0; room && i < count; ++i) {
    const auto triangle = grown(triangles[numbers.empty() ? i : numbers[i]]);
    for (std::size_t k = 0; k < 3; ++k) {
      corners[3 * i + k] = triangle[k];
      indices[3 * i + k] = static_cast<std::uint32_t>(3 * i + k);
    }
  }
  if (room) {
    rtcSetGeometryIntersectFilterFunction(geometry, takeNearest);
    if (see_through) rtcSetGeometryOccludedFilterFunction(geometry, passThrough);
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(scene, geometry, see_through ? 1 : 0);
  }
  rtcReleaseGeometry(geometry);
  return room;
}

/// Of triangles with the same corners the first alone is to be in the tree: a ray that meets one meets all, and would
/// ask each of them. False: all are, by their numbers, and all are of the first kind.
bool numberAll(std::span<const Triangle> triangles, const std::vector<bool>& see_through, Numbers& numbers) {
  auto same = findSame(triangles, see_through);
  const bool mixed = std::ranges::find(see_through, true) != see_through.end() || !same.next.empty();
  for (std::uint32_t i = 0; mixed && i < triangles.size(); ++i) {
    if (same.isFirst(i)) numbers.triangle_of[!see_through.empty() && see_through[i] ? 1 : 0].push_back(i);
  }
  numbers.next_same = std::move(same.next);
  return mixed;
}

Error errorOf(RTCDevice device) {
  const auto error = rtcGetDeviceError(device);
  if (error == RTC_ERROR_OUT_OF_MEMORY) return {ErrorCode::kTooLarge, "there is no memory for the tree of triangles"};
  return {ErrorCode::kInternal, fmt::format("Embree reports error {}", static_cast<int>(error))};
}

}  // namespace

struct RayScene::Tree {
  Device device;
  Scene scene;
  Numbers numbers;
  std::shared_ptr<const SeeThrough> passes;
};

Result<RayScene> RayScene::build(std::span<const Triangle> triangles, unsigned threads,
                                 const std::vector<bool>& see_through, std::shared_ptr<const SeeThrough> passes) {
  if (triangles.empty()) return RayScene();
  auto tree = std::make_shared<Tree>();
  const auto options = fmt::format("{},set_affinity=0{}", kInstructions, threads == 1 ? ",threads=1" : "");
  tree->device.reset(rtcNewDevice(options.c_str()));
  if (!tree->device) tree->device.reset(rtcNewDevice("set_affinity=0"));  // a processor without 256-bit vectors
  if (!tree->device) return tl::unexpected(errorOf(nullptr));
  const RTCDevice device = tree->device.get();
  tree->scene.reset(rtcNewScene(device));
  if (!tree->scene) return tl::unexpected(errorOf(device));
  rtcSetSceneFlags(tree->scene.get(), RTC_SCENE_FLAG_ROBUST);
  rtcSetSceneBuildQuality(tree->scene.get(), RTC_BUILD_QUALITY_MEDIUM);
  const bool mixed = numberAll(triangles, see_through, tree->numbers);
  tree->passes = std::move(passes);
  for (std::size_t kind = 0; kind < 2; ++kind) {
    const auto& numbers = tree->numbers.triangle_of[kind];
    const auto count = mixed ? numbers.size() : kind == 0 ? triangles.size() : 0;
    if (count > 0 && !attach(device, tree->scene.get(), triangles, numbers, count, kind == 1))
      return tl::unexpected(errorOf(device));
  }
  rtcCommitScene(tree->scene.get());
  if (const auto error = rtcGetDeviceError(device); error != RTC_ERROR_NONE) {
    if (error == RTC_ERROR_OUT_OF_MEMORY)
      return fail(ErrorCode::kTooLarge, "there is no memory for the tree of triangles");
    return fail(ErrorCode::kInternal, fmt::format("Embree reports error {}", static_cast<int>(error)));
  }
  return RayScene(std::move(tree));
}

Hit RayScene::nearest(const Ray& ray, std::span<const std::uint32_t> passed) const {
  if (!tree_) return {};
  Nearest asked;
  rtcInitIntersectContext(&asked.context);
  asked.numbers = &tree_->numbers;
  asked.own[0] = ray.own;
  asked.passed = passed;
  asked.hit[0] = {};
  RTCRayHit query{};
  query.ray = queryOf(ray);
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(tree_->scene.get(), &asked.context, &query);
  return asked.hit[0];
}

void RayScene::nearest(std::span<const Ray> rays, std::span<Hit> hits) const {
  if (rays.empty()) return;
  if (!tree_) {
    std::ranges::fill(hits, Hit{});
    return;
  }
  Nearest asked;
  rtcInitIntersectContext(&asked.context);
  asked.context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  asked.numbers = &tree_->numbers;
  alignas(32) std::array<int, kPacket> valid{};
  RTCRayHit8 query;
  for (unsigned i = 0; i < kPacket; ++i) {
    valid[i] = i < rays.size() ? -1 : 0;
    const auto& ray = rays[i < rays.size() ? i : 0];
    query.ray.org_x[i] = ray.origin.x;
    query.ray.org_y[i] = ray.origin.y;
    query.ray.org_z[i] = ray.origin.z;
    query.ray.tnear[i] = 0.0F;
    query.ray.dir_x[i] = ray.direction.x;
    query.ray.dir_y[i] = ray.direction.y;
    query.ray.dir_z[i] = ray.direction.z;
    query.ray.time[i] = 0.0F;
    query.ray.tfar[i] = ray.reach;
    query.ray.mask[i] = ~0U;
    query.ray.id[i] = i;
    query.ray.flags[i] = 0;
    query.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
    asked.own[i] = ray.own;
    asked.hit[i] = {};
  }
  rtcIntersect8(valid.data(), tree_->scene.get(), &asked.context, &query);
  std::copy_n(asked.hit.begin(), hits.size(), hits.begin());
}

bool RayScene::open(const Ray& ray) const {
  if (!tree_) return true;
  Open asked;
  rtcInitIntersectContext(&asked.context);
  asked.numbers = &tree_->numbers;
  auto query = queryOf(ray);
  rtcOccluded1(tree_->scene.get(), &asked.context, &query);
  return query.tfar >= 0.0F;
}

std::uint32_t RayScene::open(const Ways& ways, std::size_t count) const {
  const auto all = (1U << count) - 1U;
  if (!tree_) return all;
  Open asked;
  rtcInitIntersectContext(&asked.context);
  asked.context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
  asked.numbers = &tree_->numbers;
  asked.passes = tree_->passes.get();
  asked.key = ways.key.data();
  alignas(32) std::array<int, kPacket> valid{};
  RTCRay8 query;
  const auto copy = [](const Ways::Lanes& from, float* into) { std::copy(from.begin(), from.end(), into); };
  copy(ways.origin[0], query.org_x);
  copy(ways.origin[1], query.org_y);
  copy(ways.origin[2], query.org_z);
  copy(ways.direction[0], query.dir_x);
  copy(ways.direction[1], query.dir_y);
  copy(ways.direction[2], query.dir_z);
  for (unsigned i = 0; i < kPacket; ++i) {
    valid[i] = i < count ? -1 : 0;
    query.tnear[i] = query.time[i] = 0.0F;
    query.tfar[i] = 1.0F;
    query.mask[i] = ~0U;
    query.id[i] = i;
    query.flags[i] = 0;
  }
  rtcOccluded8(valid.data(), tree_->scene.get(), &asked.context, &query);
  std::uint32_t open = 0;
  for (unsigned i = 0; i < count; ++i) open |= query.tfar[i] < 0.0F ? 0U : 1U << i;
  return open;
}

}  // namespace radiosity::geometry
