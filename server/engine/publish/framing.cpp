#include "server/engine/publish/framing.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <functional>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <map>
#include <vector>

#include "common/task.h"
#include "server/geometry/bvh.h"

namespace radiosity::engine {
namespace {

constexpr double kInsideFov = 1.15, kOutsideFov = 0.7;  // radians, vertical
constexpr double kOutsideWeight = 0.8;                  // of equally good views, the one from inside the room is taken
constexpr std::size_t kFinalists = 8;
constexpr double kLandmarks = 200.0;

double luminance(const glm::vec3& c) {
  return 0.2126 * static_cast<double>(c.r) + 0.7152 * static_cast<double>(c.g) + 0.0722 * static_cast<double>(c.b);
}

/// The value below which the given share of the weight lies. Sorts; 0 when there is no weight.
double weightedQuantile(std::vector<std::pair<double, double>>& value_weight, double share) {
  std::sort(value_weight.begin(), value_weight.end(), interruptible(std::less<>()));
  double total = 0.0;
  for (const auto& entry : value_weight) total += entry.second;
  double sum = 0.0;
  for (const auto& [value, weight] : value_weight) {
    sum += weight;
    if (sum >= share * total && weight > 0.0) return value;
  }
  return 0.0;
}

struct Box {
  glm::dvec3 low{-0.5}, high{0.5};
  [[nodiscard]] glm::dvec3 middle() const { return 0.5 * (low + high); }
  [[nodiscard]] glm::dvec3 size() const { return high - low; }
};

/// An eye and its axes in the unit box. `tangent`: of half the horizontal and vertical field of view.
struct View {
  glm::dvec3 eye{0.0}, right{1.0, 0.0, 0.0}, up{0.0, 1.0, 0.0}, back{0.0, 0.0, 1.0};
  double tan_x = 1.0, tan_y = 1.0, fov = kInsideFov;
  bool inside = true;
  double score = 0.0;
};

View lookAlong(const glm::dvec3& forward, double fov, double aspect) {
  View view;
  view.back = -glm::normalize(forward);
  view.right = glm::normalize(glm::cross(glm::dvec3(0.0, 1.0, 0.0), view.back));
  view.up = glm::cross(view.back, view.right);
  view.fov = fov;
  view.tan_y = std::tan(0.5 * fov);
  view.tan_x = view.tan_y * aspect;
  return view;
}

/// The lit scene for rays: unit box, triangles of the patch scene, irradiance on the pages.
class Scout {
 public:
  Scout(const scene::Scene& scene, const scene::PatchScene& patches, std::span<const Image> pages);

  [[nodiscard]] const Box& bounds() const { return bounds_; }  ///< of everything
  [[nodiscard]] const Box& lit() const { return lit_; }        ///< where 96 % of the light arrives
  [[nodiscard]] const glm::dvec3& centre() const { return centre_; }

  /// 0 to about 1; from columns x 3/4 columns rays.
  [[nodiscard]] double score(const View& view, int columns);

 private:
  /// A point that stands for an equal share of the scene's light.
  struct Landmark {
    glm::dvec3 position, normal;  ///< of the side that the light falls on
  };
  /// What a ray sees first that is drawn.
  struct Sight {
    double distance = 0.0;
    std::uint32_t triangle = scene::kNone;
    std::size_t side = 0;       ///< of the triangle, that one looks at; 1: its back
    bool through_back = false;  ///< an undrawn back face came first
  };
  [[nodiscard]] Sight cast(const glm::dvec3& eye, const glm::dvec3& direction);
  [[nodiscard]] double irradianceAt(const Sight& sight, const glm::dvec3& point) const;
  /// 0 where that side has no texels: it is dark.
  [[nodiscard]] double pageValue(const scene::Surface& surface, std::size_t side, glm::vec2 texel) const;
  void measureLight();
  [[nodiscard]] double overview(const View& view);

  const scene::Scene& scene_;
  const scene::PatchScene& patches_;
  std::span<const Image> pages_;
  scene::Bvh bvh_;
  Box bounds_, lit_;
  glm::dvec3 centre_{0.0};
  std::vector<Landmark> landmarks_;
  double typical_ = 0.0;  // irradiance of the lit part; 0: all is black
  std::vector<scene::RayHit> hits_;
};

Scout::Scout(const scene::Scene& scene, const scene::PatchScene& patches, std::span<const Image> pages)
    : scene_(scene), patches_(patches), pages_(pages) {
  std::vector<scene::Bvh::Triangle> triangles(patches.indices.size() / 3);
  if (!triangles.empty()) bounds_ = {glm::dvec3(1e30), glm::dvec3(-1e30)};
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (std::size_t c = 0; c < 3; ++c) {
      triangles[t][c] = patches.vertices[patches.indices[3 * t + c]].position;
      bounds_.low = glm::min(bounds_.low, glm::dvec3(triangles[t][c]));
      bounds_.high = glm::max(bounds_.high, glm::dvec3(triangles[t][c]));
    }
  }
  bvh_ = scene::Bvh(std::move(triangles));
  measureLight();
}

double Scout::pageValue(const scene::Surface& surface, std::size_t side, glm::vec2 texel) const {
  const auto& place = surface.place[side];
  if (place.page >= pages_.size()) return 0.0;
  const auto& page = pages_[place.page];
  const int x = static_cast<int>(place.x) + static_cast<int>(texel.x);
  const int y = static_cast<int>(place.y) + static_cast<int>(texel.y);
  if (x < 0 || y < 0 || x >= page.width || y >= page.height) return 0.0;
  return std::max(luminance(page.at(x, y)), 0.0);
}

void Scout::measureLight() {
  struct Sample {
    glm::dvec3 position;
    glm::vec3 normal;
    double area, irradiance;
  };
  std::vector<Sample> samples;
  for (const auto& surface : patches_.surfaces) {
    for (std::uint32_t i = 0; i < surface.width * surface.height; ++i) {
      const auto& leaf = patches_.leaves[surface.first_leaf + i];
      if (leaf.triangle == scene::kNone) continue;
      const auto& frame = patches_.triangles[leaf.triangle];
      const glm::dvec3 position(frame.origin + leaf.texel.x * frame.du + leaf.texel.y * frame.dv);
      for (std::size_t side = 0; side < 2; ++side) {
        if (surface.first_node[side] == scene::kNone) continue;
        samples.push_back({position, side == 0 ? frame.normal : -frame.normal, static_cast<double>(surface.texel_area),
                           pageValue(surface, side, leaf.texel)});
      }
    }
  }
  const auto quantile = [&samples](const auto& value, const auto& weight, double share) {
    std::vector<std::pair<double, double>> list;
    list.reserve(samples.size());
    for (const auto& s : samples) list.emplace_back(value(s), weight(s));
    return weightedQuantile(list, share);
  };
  // Half the light arrives where it is brighter than this. The brightest spots (a lamp's surroundings) count as the
  // rest.
  const auto root = [](const Sample& s) { return s.area * std::sqrt(s.irradiance); };
  typical_ = quantile([](const Sample& s) { return s.irradiance; }, root, 0.5);
  const auto weight = [this](const Sample& s) {
    return s.area * (typical_ > 0.0 ? std::min(s.irradiance, 2.0 * typical_) : 1.0);
  };
  lit_ = bounds_;
  centre_ = bounds_.middle();
  if (samples.empty()) return;
  for (int axis = 0; axis < 3; ++axis) {
    const auto coordinate = [axis](const Sample& s) { return s.position[axis]; };
    lit_.low[axis] = quantile(coordinate, weight, 0.02);
    lit_.high[axis] = quantile(coordinate, weight, 0.98);
    centre_[axis] = quantile(coordinate, weight, 0.5);
  }
  centre_ = 0.5 * (centre_ + lit_.middle());
  double total = 0.0, sum = 0.0;
  for (const auto& sample : samples) total += weight(sample);
  for (const auto& sample : samples) {
    sum += weight(sample);
    if (sum * kLandmarks < total * (static_cast<double>(landmarks_.size()) + 0.5)) continue;
    landmarks_.push_back({sample.position, glm::dvec3(sample.normal)});
  }
}

/// The share of the scene's light that is in the picture.
double Scout::overview(const View& view) {
  double seen = 0.0;
  for (const auto& landmark : landmarks_) {
    const auto to = landmark.position - view.eye;
    const double depth = -glm::dot(to, view.back);
    if (depth <= 0.0 || std::abs(glm::dot(to, view.right)) > depth * view.tan_x) continue;
    if (std::abs(glm::dot(to, view.up)) > depth * view.tan_y) continue;
    if (glm::dot(to, landmark.normal) >= 0.0) continue;
    if (cast(view.eye, to).distance > 0.998) seen += 1.0;
  }
  return seen / std::max(1.0, static_cast<double>(landmarks_.size()));
}

Scout::Sight Scout::cast(const glm::dvec3& eye, const glm::dvec3& direction) {
  hits_.clear();
  bvh_.collectHits(eye, direction, 1e-7, 1e9, hits_);
  Sight sight;
  double back = 1e30, drawn = 1e30;
  for (const auto& hit : hits_) {
    const auto& surface = patches_.surfaces[patches_.triangle_surface[hit.triangle]];
    if (!hit.front && !surface.shows_back) {
      back = std::min(back, hit.t);
    } else if (hit.t < drawn) {
      drawn = hit.t;
      sight.triangle = hit.triangle;
      sight.side = hit.front ? 0 : 1;
    }
  }
  sight.distance = drawn;
  sight.through_back = back < drawn;
  return sight;
}

double Scout::irradianceAt(const Sight& sight, const glm::dvec3& point) const {
  std::array<glm::dvec3, 3> p{};
  std::array<glm::vec2, 3> texel{};
  for (std::size_t c = 0; c < 3; ++c) {
    const auto& vertex = patches_.vertices[patches_.indices[std::size_t{3} * sight.triangle + c]];
    p[c] = glm::dvec3(vertex.position);
    texel[c] = vertex.texel;
  }
  const auto normal = glm::cross(p[1] - p[0], p[2] - p[0]);
  const double area = std::max(glm::dot(normal, normal), 1e-300);
  const auto u = static_cast<float>(glm::dot(glm::cross(point - p[0], p[2] - p[0]), normal) / area);
  const auto v = static_cast<float>(glm::dot(glm::cross(p[1] - p[0], point - p[0]), normal) / area);
  return pageValue(patches_.surfaces[patches_.triangle_surface[sight.triangle]], sight.side,
                   texel[0] + u * (texel[1] - texel[0]) + v * (texel[2] - texel[0]));
}

double Scout::score(const View& view, int columns) {
  const int rows = columns * 3 / 4;
  const double near = 0.12 * glm::length(lit_.size());
  double lit = 0.0, seen = 0.0, close = 0.0, backs = 0.0;
  std::map<std::uint32_t, double> light_of;  // by surface
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) {
      const double sx = (2.0 * x + 1.0) / columns - 1.0, sy = (2.0 * y + 1.0) / rows - 1.0;
      const auto ray = sx * view.tan_x * view.right + sy * view.tan_y * view.up - view.back;
      const auto sight = cast(view.eye, ray);
      backs += sight.through_back ? 1.0 : 0.0;
      if (sight.triangle == scene::kNone) continue;
      seen += 1.0;
      close += std::max(0.0, 1.0 - sight.distance / near);
      const double irradiance = irradianceAt(sight, view.eye + sight.distance * ray);
      const double light = typical_ > 0.0 ? irradiance / (irradiance + 0.25 * typical_) : 1.0;
      lit += light;
      light_of[patches_.triangle_surface[sight.triangle]] += light;
    }
  }
  if (lit <= 0.0) return 0.0;
  double entropy = 0.0;  // bits: how many different things share the light
  for (const auto& [surface, light] : light_of) {
    if (light > 0.0) entropy -= light / lit * std::log2(light / lit);
  }
  const double rays = static_cast<double>(columns) * rows;
  const double interest = 0.5 * std::min(1.0, entropy / 4.0) + 0.5 * std::min(1.0, overview(view) / 0.6);
  if (!view.inside) {
    // A room seen through its culled walls is a doll's house: better than nothing.
    return kOutsideWeight * lit / seen * std::min(1.0, 2.0 * seen / rays) * interest *
           (1.0 - 0.8 * backs / std::max(seen, backs));
  }
  const double enclosed = std::clamp((seen / rays - 0.4) / 0.4, 0.0, 1.0);  // an open place has no inside
  const double clear = std::max(0.0, 1.0 - 3.0 * close / rays), solid = std::max(0.0, 1.0 - 8.0 * backs / rays);
  return lit / rays * enclosed * interest * clear * solid;
}

/// Eyes along the sides and in the corners of the lit part, at some heights, looking across it; at most 25 degrees up
/// or down.
void addInside(const Scout& scout, double metre, double aspect, std::vector<View>& views) {
  const Box& box = scout.lit();
  const double height = box.size().y;
  std::vector<double> heights = {0.4 * height, 0.6 * height, 0.75 * height};
  if (1.6 * metre > 0.3 * height && 1.6 * metre < 0.8 * height) heights[0] = 1.6 * metre;
  for (const double h : heights) {
    for (const double inset : {0.06, 0.16, 0.28}) {
      for (int i = 0; i < 9; ++i) {
        if (i == 4) continue;  // the middle
        const glm::dvec3 share(inset + (1.0 - 2.0 * inset) * 0.5 * (i % 3), 0.0,
                               inset + (1.0 - 2.0 * inset) * 0.5 * static_cast<double>(i / 3));
        auto eye = box.low + share * box.size();
        eye.y = box.low.y + h;
        auto forward = scout.centre() - eye;
        const double flat = std::hypot(forward.x, forward.z);
        if (flat < 1e-6) continue;
        forward.y = std::clamp(forward.y, -0.45 * flat, 0.45 * flat);
        views.push_back(lookAlong(forward, kInsideFov, aspect));
        views.back().eye = eye;
      }
    }
  }
}

/// Eyes around the scene, level and from above, just so far away that the whole box is in view.
void addOutside(const Scout& scout, double aspect, std::vector<View>& views) {
  const Box& box = scout.bounds();
  for (const double rise : {0.12, 0.5, 0.9}) {
    for (int i = 0; i < 12; ++i) {
      const double angle = 0.52359877559829887 * i;
      auto view = lookAlong({-std::sin(angle), -rise, -std::cos(angle)}, kOutsideFov, aspect);
      view.inside = false;
      double distance = 1e-6;
      for (unsigned corner = 0; corner < 8; ++corner) {
        const glm::dvec3 high((corner & 1U) != 0U, (corner & 2U) != 0U, (corner & 4U) != 0U);
        const auto to = box.low + high * box.size() - box.middle();
        const double across =
            std::max(std::abs(glm::dot(to, view.right)) / view.tan_x, std::abs(glm::dot(to, view.up)) / view.tan_y);
        distance = std::max(distance, glm::dot(to, view.back) + 1.06 * across);
      }
      view.eye = box.middle() + distance * view.back;
      views.push_back(view);
    }
  }
}

}  // namespace

scene::Camera frameScene(const scene::Scene& scene, const scene::PatchScene& patches, std::span<const Image> pages,
                         double aspect) {
  Scout scout(scene, patches, pages);
  std::vector<View> views;
  addOutside(scout, aspect, views);
  addInside(scout, 1.0 / patches.scale, aspect, views);
  for (auto& view : views) {
    interruptionPoint();
    view.score = scout.score(view, 16);
  }
  const auto better = [](const View& a, const View& b) { return a.score > b.score; };
  std::stable_sort(views.begin(), views.end(), better);
  views.resize(std::min(views.size(), kFinalists));
  for (auto& view : views) {
    interruptionPoint();
    view.score = scout.score(view, 44);
  }
  std::stable_sort(views.begin(), views.end(), better);
  const View& best = views.front();
  scene::Camera camera;
  camera.name = "framed";
  camera.world = glm::dmat4(glm::dvec4(best.right, 0.0), glm::dvec4(best.up, 0.0), glm::dvec4(best.back, 0.0),
                            glm::dvec4(best.eye * patches.scale + patches.centre, 1.0));
  camera.yfov_rad = best.fov;
  camera.znear = patches.scale * 1e-3;
  return camera;
}

Result<std::optional<scene::Camera>> chooseCamera(const scene::Scene& scene, const std::string& wanted) {
  const auto& cameras = scene.cameras;
  if (wanted.empty()) return cameras.empty() ? std::nullopt : std::optional(cameras.front());
  for (const auto& camera : cameras) {
    if (camera.name == wanted) return camera;
  }
  std::size_t index = 0;
  const auto parsed = std::from_chars(wanted.data(), wanted.data() + wanted.size(), index);
  if (parsed.ec == std::errc() && parsed.ptr == wanted.data() + wanted.size() && index < cameras.size()) {
    return cameras[index];
  }
  return fail(ErrorCode::kNotFound,
              "the scene has no camera \"" + wanted + "\" (it has " + std::to_string(cameras.size()) + ")");
}

std::optional<float> exposureOf(const Image& radiance) {
  std::vector<std::pair<double, double>> lit;
  for (const auto& pixel : radiance.pixels) {
    interruptionPoint();
    const double value = luminance(pixel);
    // By its fourth root neither a large dark nor a small bright area outweighs what one wants to see: lamps of 2,000
    // times its light would have to cover an eighth of the picture, a dark of a thousandth 85 %.
    if (value > 0.0 && std::isfinite(value)) lit.emplace_back(value, std::pow(value, 0.25));
  }
  constexpr double kRange = 24.0;
  const double typical = weightedQuantile(lit, 0.5);
  double sum = 0.0;
  std::size_t count = 0;
  for (const auto& [value, weight] : lit) {
    if (value < typical / kRange || value > typical * kRange) continue;
    sum += std::log(value);
    ++count;
  }
  constexpr double kMost = 9.9e29;  // a picture of next to nothing: what may be asked for
  if (count == 0) return std::nullopt;
  return static_cast<float>(std::min(kMost, 0.18 / std::exp(sum / static_cast<double>(count))));
}

float autoExposure(const Image& radiance) { return exposureOf(radiance).value_or(1.0F); }

}  // namespace radiosity::engine
