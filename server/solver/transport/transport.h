// The interface between the solver, which decides what to shoot, and whoever carries the light (the GL hemicube
// renderer and its worker processes; a ray caster in the tests). Lengths are in the unit box of PatchScene, flux in lux
// x unit^2.
//
// Everything a shot delivers is rounded to integers, once a node and shot, and added: the order of shots, and the
// number of workers, cannot change a bit of the result, and a shot replayed with the opposite sign cancels exactly.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <string>
#include <vector>

#include "common/result.h"
#include "server/scene/values/patch_scene.h"
#include "server/solver/transport/lamp_shape.h"

namespace radiosity::solver {

/// Number of subpixel offsets of the hemicube's lattice: a kLatticeSide x kLatticeSide grid, so that the exact pixel
/// weights of each can be tabulated.
inline constexpr std::uint32_t kLatticeSide = 4;
/// Pixel weights of one hemicube are integers that sum to exactly this.
inline constexpr std::uint32_t kWeightOne = 1U << 30;

/// Where a hemicube stands. tangent is a unit vector in the surface's plane, random rotation included.
struct HemicubeFrame {
  glm::vec3 origin, normal, tangent;
  std::uint32_t lattice = 0;  ///< index of the subpixel offset, < kLatticeSide^2
  bool operator==(const HemicubeFrame&) const = default;
};

/// Scatter: a full hemicube of mip-level node IDs; each pixel delivers flux x weight to the node it names.
struct ScatterShot {
  HemicubeFrame frame;
  std::uint32_t resolution = 64;  ///< N: the top face is N x N pixels
  float level_bias = 0.0F;        ///< added to the exact level before floor; includes the shot's random u in [0, 1)
  std::array<double, 3> flux{};   ///< signed, per channel
  std::uint32_t half = 0;         ///< which of the two independent accumulators receives it
};

/// Where the flux of a shot goes: one of the two independent halves, or, for a gather shot, the first half of its
/// points to the first and the rest to the second, each carrying half of the radiosity.
inline constexpr std::uint32_t kBothHalves = 2;

/// Consecutive nodes.
struct NodeRun {
  std::uint32_t first_node, count;
  bool operator==(const NodeRun&) const = default;
};

/// A set of looks, each from one point, by number; of those that are too many all or none are in it.
struct Looks {
  std::uint64_t bits = 0;

  static constexpr std::uint32_t kMany = 63;  ///< this one and all that follow share a bit
  [[nodiscard]] bool has(std::uint32_t look) const { return (bits >> std::min(look, kMany) & 1U) != 0; }
  void add(std::uint32_t look) { bits |= std::uint64_t{1} << std::min(look, kMany); }
  /// The looks of another set, counted from `first`.
  void add(const Looks& others, std::uint32_t first, std::uint32_t count) {
    for (std::uint32_t look = 0; look < count && others.bits != 0; ++look) {
      if (others.has(look)) add(first + look);
    }
  }
  /// `count` of them, from `first` on.
  [[nodiscard]] Looks from(std::uint32_t first, std::uint32_t count) const {
    Looks looks;
    for (std::uint32_t look = 0; look < count && bits != 0; ++look) {
      if (has(first + look)) looks.add(look);
    }
    return looks;
  }
  bool operator==(const Looks&) const = default;
};

/// Gather: light of one convex planar polygon of uniform radiosity at every leaf. For each point on the polygon an item
/// buffer gives visibility; irradiance = radiosity x exact polygon form factor (Lambert) x mean visibility weighted by
/// cos cos / r^2.
inline constexpr std::size_t kMaxCorners = 8;  ///< a rectangle clipped by a quadrilateral
struct GatherShot {
  std::array<glm::vec3, kMaxCorners> corners{};
  std::uint32_t corner_count = 3;  ///< 3 to kMaxCorners, counter-clockwise seen from the lit side
  glm::vec3 normal{0.0F};
  std::array<double, 3> radiosity{};  ///< signed, lm/m^2, times the shot's weight in the average
  /// The part of the polygon that shines, when something covers the rest (a floor under a block) or nothing is there.
  /// Which part is not known from afar; a receiver whose horizon cuts the polygon is taken to see the shining part
  /// first, as the block's own sides do. Receivers close by find it out from the leaves.
  float fill = 1.0F;
  std::uint32_t triangle = scene::kNone;  ///< its frame is that of the leaves under the polygon; kNone: there are none
  std::uint32_t side = 0;                 ///< of the triangle's surface: 0 front, 1 back
  std::uint32_t resolution = 128;
  glm::vec2 receiver_jitter{0.5F};  ///< where in a leaf the receiving point lies (PatchScene::spotAt)
  scene::SpotDraw spots;            ///< where a leaf has spots, which are the first
  std::uint32_t spot_rows = 1;      ///< how many of them count: a power of two, at most kSpotRows
  std::uint32_t half = 0;
  std::uint32_t first_point = 0, point_count = 0;  ///< into ShotBatch::points
  /// Of a light of 3 or 4 corners that receivers see by rays: each looks at points of its own, those of Sobol's
  /// sequence from `first_draw` on, scrambled by the key, turned leaf by leaf. 0: all look at the points of the batch.
  std::uint64_t own_points_key = 0;
  std::uint32_t first_draw = 0;
  /// Into ShotBatch::receivers, for measure(): only links to these leaves are wanted, others may be left out. 0: all.
  std::uint32_t first_run = 0, run_count = 0;
  /// Into ShotBatch::boxes, of a shot that names its receivers: what escapes and what is absorbed is wanted only where
  /// the points see these boxes or the receivers, and may be left out elsewhere. 0: everywhere.
  std::uint32_t first_box = 0, box_count = 0;
  Looks open_looks;  ///< points of which all that escapes and is absorbed is wanted nevertheless
  bool operator==(const GatherShot&) const = default;
};

/// Receiving points inside a full leaf over which a shot of light without extent is averaged, as (u, v) in [0, 1)^2.
inline constexpr std::size_t kMaxReceiverPoints = 8;
struct ReceiverPoints {
  std::array<glm::vec2, kMaxReceiverPoints> at{};
  std::uint32_t count = 1;  ///< 1 to kMaxReceiverPoints
};

/// Half of the space around a point light, or a spot: irradiance I cos / d^2, exact at every receiving point;
/// visibility from one hemicube image.
struct PointShot {
  HemicubeFrame frame;                ///< at the light; normal: axis of the half space, or of the spot's cone
  std::array<double, 3> intensity{};  ///< signed, lux x unit^2 (candela in the unit box), times the shot's weight
  float cone_scale = 0.0F;            ///< falloff clamp(cos x scale + offset, 0, 1)^2 about the normal
  float cone_offset = 1.0F;           ///< (KHR_lights_punctual, "Inner and Outer Cone Angles")
  float range = 0.0F;                 ///< unit; beyond it nothing arrives (faded, "Range Property"); 0: no limit
  std::array<double, 3> emitted{};    ///< flux the shot stands for, lux x unit^2; what the scene does not catch escapes
  std::uint32_t resolution = 256;
  std::uint32_t half = 0;
  ReceiverPoints receivers;
};

/// All of a lamp with a size or a web: each receiving point looks at a point of it, by a ray. (An image from the lamp
/// would be from one of its points alone.)
struct LampShot {
  LampShape shape;
  std::uint32_t first_web = 0, web_size = 0;  ///< into ShotBatch::webs
  std::array<double, 3> intensity{};          ///< signed; as in PointShot
  std::array<double, 3> emitted{};
  std::array<glm::vec2, kMaxReceiverPoints> at{};  ///< on the lamp, in [0, 1)^2; turned by each leaf
  std::uint64_t key = 0;  ///< of the turns: the same in all shots of a half, so that their points stay spread evenly
  std::uint32_t half = 0;
  ReceiverPoints receivers;
};

/// Light from infinity, seen in a parallel projection of the whole scene.
struct ParallelView {
  glm::vec3 direction{0.0F};  ///< unit, towards the light
  glm::vec3 right{0.0F};      ///< unit, across; random about the direction
  glm::vec2 shift{0.0F};      ///< of the image, in pixels, [0, 1)
};

/// One directional light, or a part of the directions that stand for a hemisphere of uniform sky.
struct ParallelShot {
  std::array<double, 3> irradiance{};  ///< signed, lux from each direction on a surface that faces it, times the weight
  std::array<double, 3> emitted{};     ///< flux that enters the scene's box, lux x unit^2
  std::uint32_t first_view = 0, view_count = 1;  ///< into ShotBatch::views
  /// Sky: all directions that stand for the hemisphere around `axis`. Their sum is scaled to what the whole hemisphere
  /// gives a surface of the receiver's normal, pi (1 + cos) / 2 per unit of radiance, so an open plane is exact.
  std::uint32_t first_of_sky = 0, sky_count = 0;  ///< 0: a directional light
  glm::vec3 axis{0.0F};
  std::uint32_t resolution = 512;
  std::uint32_t half = 0;
  ReceiverPoints receivers;
};

enum class LinkMode : std::uint32_t {
  kFormula,      ///< level from the exact pixel footprint, node ID by arithmetic (default)
  kPaperMipmap,  ///< NEAREST_MIPMAP_NEAREST usampler2D with composed IDs, the hardware chooses the level (Lum, Ma, Max
                 ///< 2002)
};

/// Work that may be done in any order and by anyone.
struct ShotBatch {
  LinkMode mode = LinkMode::kFormula;
  bool may_be_put_off = false;  ///< see Transport::setImpatience()
  double flux_scale = 1.0;      ///< integers = round(flux x flux_scale); a power of two
  std::vector<ScatterShot> scatter;
  std::vector<GatherShot> gather;
  std::vector<HemicubeFrame> points;  ///< light points of the gather shots
  std::vector<NodeRun> receivers;     ///< of the gather shots that want not all; leaves
  std::vector<scene::ChangedBox> boxes;
  std::vector<PointShot> point_lights;
  std::vector<ParallelShot> parallel;
  std::vector<ParallelView> views;  ///< of the parallel shots
  std::vector<LampShot> lamps;
  std::vector<float> webs;  ///< tables (LightWeb) of the lamps, one after the other

  [[nodiscard]] bool empty() const {
    return scatter.empty() && gather.empty() && point_lights.empty() && parallel.empty() && lamps.empty();
  }
};

using Flux3 = std::array<std::int64_t, 3>;

/// What came of it. `node[half][id]` is the flux delivered directly to that node (not yet pushed or pulled).
struct FluxAccumulators {
  std::array<std::vector<Flux3>, 2> node;
  Flux3 escaped{};    ///< left the scene
  Flux3 backface{};   ///< absorbed by the unlit side of a single-sided surface
  Flux3 scattered{};  ///< sum delivered to nodes by scatter shots
  Flux3 gathered{};   ///< sum delivered to leaves by gather shots

  void reset(std::size_t node_count);
};

/// What was done, for reports. Times are summed over workers.
struct TransportCounters {
  std::uint64_t scatter_shots = 0, gather_shots = 0, gather_points = 0;
  std::uint64_t point_images = 0, parallel_images = 0;  ///< of lights without extent
  std::uint64_t pixels = 0;                             ///< visibility samples rendered and accumulated
  std::uint64_t links = 0;                              ///< (shot, node) pairs that received flux
  /// Summed over the faces of hemicubes, and over parallel images. Of those culled some lay between the sample points
  /// of pixels, some behind others.
  std::uint64_t triangles_drawn = 0, triangles_culled = 0;
  std::uint64_t triangles_between = 0, triangles_hidden = 0;
  std::uint64_t faces = 0, faces_empty = 0;  ///< of hemicubes; those in which nothing is drawn
  double render_seconds = 0.0, accumulate_seconds = 0.0, gather_seconds = 0.0;

  TransportCounters& operator+=(const TransportCounters& other);
};

/// Integers of a shot whose links are measured: its flux is at most about the area of the unit box's faces.
inline constexpr double kMeasureScale = 1125899906842624.0;  // 2^50

/// What one shot brings where, for a radiosity (gather) or flux (scatter) of one: its links. Nodes of any level may be
/// named; a node that is named twice receives both.
struct LinkSample {
  using Run = NodeRun;
  std::vector<Run> runs;
  std::vector<float> irradiance;         ///< mean over each node of the runs, one run after the other
  double escaped = 0.0, absorbed = 0.0;  ///< flux that left the scene, and that fell on unlit sides
  /// Flux that arrives by the links, and that should by what neither escapes nor is absorbed. One point of view may
  /// find half or twice as much; the ratio of their means over many is near one (LinkColumn::gain). 0: nothing is
  /// known.
  double delivered = 0.0, due = 0.0;
  Looks open_looks;  ///< of a gather shot: its points from where something of that escapes or is absorbed

  void add(std::uint32_t node, float value) {
    if (runs.empty() || runs.back().first_node + runs.back().count != node) runs.push_back({node, 0});
    ++runs.back().count;
    irradiance.push_back(value);
  }
  /// The same from a flux in units of 1 / kMeasureScale. What fell on a node without area (a sliver that only the
  /// rasteriser saw) is absorbed.
  void addFlux(std::uint32_t node, std::int64_t flux, const scene::PatchScene& patches);
  void scale(double factor);
};

/// Corners of the box around all triangles, low and high, unit box. What light from infinity enters the scene is what
/// enters this box. Zero for an empty scene.
[[nodiscard]] std::array<glm::vec3, 2> sceneBox(const scene::PatchScene& patches);
/// Area of the box as seen from a direction (unit vector), unit^2.
[[nodiscard]] double boxSilhouette(const std::array<glm::vec3, 2>& box, const glm::vec3& direction);

class Transport {
 public:
  virtual ~Transport() = default;

  /// Uploads geometry; must come before run(). Blocks.
  [[nodiscard]] virtual Result<void> setScene(std::shared_ptr<const scene::PatchScene> patches) = 0;
  /// What renderers take of a scene. Each transport knows its own.
  class Prepared {
   public:
    virtual ~Prepared() = default;
  };
  /// Makes it for beginScene(), which has less to do then. From any thread, beside whatever else the transport does.
  /// Null: there is nothing to prepare.
  [[nodiscard]] virtual Result<std::unique_ptr<Prepared>> prepareScene(const scene::PatchScene& /*patches*/) const {
    return nullptr;
  }
  /// The same as setScene() in two steps, the second of which is to come before anything else but another setScene() or
  /// beginScene(): between them renderers may take the scene in by themselves. `prepared`: of this scene; null: that is
  /// done here.
  [[nodiscard]] virtual Result<void> beginScene(std::shared_ptr<const scene::PatchScene> patches,
                                                std::unique_ptr<Prepared> /*prepared*/ = nullptr) {
    return setScene(std::move(patches));
  }
  [[nodiscard]] virtual Result<void> finishScene() { return {}; }
  /// Between the two: finishScene() would not wait. Does not wait itself.
  [[nodiscard]] virtual bool hasTakenScene() { return true; }

  /// Carries out the batch and adds what it delivered to `into` (sized by the caller). Blocks. On error `into` is
  /// unchanged.
  [[nodiscard]] virtual Result<TransportCounters> run(const ShotBatch& batch, FluxAccumulators& into) = 0;

  /// Takes the links of a shot of a batch.
  using TakeLinks = std::function<void(std::size_t shot, LinkSample&& links)>;
  /// Measures the links of every gather shot, then of every scatter shot, by itself: its radiosity or flux is taken as
  /// one, its half is ignored. Calls `take` in the calling thread, in the order of the shots, while others are still
  /// under way. Blocks. After an error some shots may have been taken. The default carries out one shot after the other
  /// with run().
  [[nodiscard]] virtual Result<TransportCounters> measure(const ShotBatch& batch, const TakeLinks& take);

  /// `is_wanted` is called now and then, in the thread that uses the transport, by run() and measure(): whether that
  /// thread is wanted for something else. If so, a batch that may be put off, and has taken a tenth of a second, ends
  /// with kCancelled: of measure() those shots are done that were taken. A transport whose calls are short need not do
  /// anything.
  virtual void setImpatience(std::function<bool()> /*is_wanted*/) {}

  /// What runs in setScene(), run() or measure() fails soon, and everything after it at once: the solve thread is
  /// wanted for its end. From any thread. A transport whose calls are short need not do anything.
  virtual void interrupt() {}

  /// Renderers that died, hung or lost their context, and were replaced, since the transport was made. For the thread
  /// that uses it.
  struct Losses {
    std::uint64_t count = 0;
    std::string last;  ///< why
  };
  [[nodiscard]] virtual Losses losses() const { return {}; }

  struct Renderers {
    std::size_t wanted = 1, missing = 0;
    std::string why;  ///< the last one ended; empty: none is missing
  };
  /// Looks which renderers have ended while nothing was asked of them; what runs does so by itself. Those it finds
  /// count as lost. Does not wait. For the thread that uses the transport, between its calls.
  [[nodiscard]] virtual Renderers look() { return {}; }
  /// Replaces those that are missing, which then have the present scene. Blocks while they start, under a second each
  /// where the driver's shaders are compiled already. On error some are still missing.
  [[nodiscard]] virtual Result<void> replaceMissing() { return {}; }

  /// "llvmpipe (LLVM 15.0.6, 256 bits), 2 workers"
  [[nodiscard]] virtual std::string description() const = 0;

 protected:
  /// For the default measure(): how many nodes there are and their areas.
  [[nodiscard]] virtual std::shared_ptr<const scene::PatchScene> scene() const = 0;
};

}  // namespace radiosity::solver
