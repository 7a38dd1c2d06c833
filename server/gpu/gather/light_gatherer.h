// Direct light of a polygon at every leaf: exact form factor times visibility, which rays to points on the light
// decide, or item buffers rendered from these. One thread.
//
// By rays each receiver looks at points of its own, so that few of them make the edge of a shadow grainy, which is
// smoothed away (DirectSmoothing); by item buffers all look at the same, which makes it stepped.
//
// A leaf is hidden from a light point only if it lies behind the plane of the triangle seen in its direction: no depth
// bias, hence no acne, and light does not leak under blocks. At convex edges, where the pixel may belong to the surface
// on the other side, the next pixels are asked too.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "server/gpu/cull/hemicube_weights.h"
#include "server/gpu/cull/view_window.h"
#include "server/gpu/draw/image_source.h"
#include "server/gpu/gather/flux_sink.h"
#include "server/gpu/gather/form_factor_kernel.h"
#include "server/gpu/gather/receivers.h"

namespace radiosity::gpu {

class LightGatherer {
 public:
  LightGatherer() = default;
  explicit LightGatherer(std::shared_ptr<const Receivers> receivers);

  void gather(const solver::GatherShot& shot, std::span<const solver::HemicubeFrame> points, double flux_scale,
              ImageSource& source, WeightCache& weights, const FluxSink& sink, solver::TransportCounters& counters);
  /// The same by rays.
  void gather(const solver::GatherShot& shot, std::span<const solver::HemicubeFrame> points, double flux_scale,
              const FluxSink& sink, solver::TransportCounters& counters);

  /// Links of one shot, in steps, so that item buffers of several shots can be drawn at once: begin, one look for each
  /// point, finish.
  /// Of shots that want links to some receivers only, `named` are these, ascending.
  void beginLinks(const solver::GatherShot& shot, std::span<const solver::NodeRun> named = {});
  void look(const solver::GatherShot& shot, const solver::HemicubeFrame& point, std::span<const std::uint32_t> items,
            const HemicubeWeights& weights, const ViewWindow* window = nullptr);
  /// The same by rays: what the light loses on all sides is found, whichever links are wanted. Interrupted, the same
  /// look goes on from there when it is made again.
  void look(const solver::GatherShot& shot, const solver::HemicubeFrame& point);
  /// That are done since beginLinks().
  [[nodiscard]] std::uint32_t lookCount() const { return look_count_; }
  /// Grows with all that looks by rays find out.
  [[nodiscard]] std::array<std::uint32_t, 3> place() const { return {look_count_, asked_.receivers, asked_.edges}; }
  /// Finds the places of some receivers, for windowOf() at all points of the shot.
  void findWanted(const solver::GatherShot& shot, std::span<const solver::NodeRun> named);
  /// What a look at these, and at boxes, can show; nothing where that is nearly all.
  [[nodiscard]] std::optional<ViewWindow> windowOf(const solver::GatherShot& shot, const solver::HemicubeFrame& point,
                                                   std::span<const scene::ChangedBox> boxes) const;
  void finishLinks(const solver::GatherShot& shot, solver::LinkSample& sample, solver::TransportCounters& counters);

 private:
  /// Receivers that the polygon faces and that face it, with what the points found so far in either half.
  struct Lit {
    std::vector<float> x, y, z, nx, ny, nz;
    std::vector<float> form_factor;  ///< times the receiving point's share of its leaf
    std::vector<float> share;        ///< that one
    std::vector<std::uint32_t> node;
    std::vector<std::uint32_t> care;      ///< Receivers::careOf
    std::vector<std::uint32_t> doubt;     ///< what questions the pixel of the point being tested leaves
    std::vector<std::uint32_t> doubtful;  ///< those with some
    std::vector<float> front;             ///< part of what shines that lies before the receiver's plane
    std::array<std::vector<float>, 2> weight, visible_weight;
    std::vector<float> point_weight;               ///< of the point being tested
    std::vector<std::uint32_t> pixel;              ///< in which it sees the receiver
    std::vector<std::uint32_t> turn;               ///< Receivers::turnOf
    std::vector<float> light_x, light_y, light_z;  ///< the points that receivers look at, of their own
    std::vector<float> visibility;                 ///< as findVisibility last found it

    void resize(std::size_t count);
  };
  /// Places from which the other half looks at what shines, of receivers that wait for their form factors.
  struct Others {
    std::vector<float> x, y, z, nx, ny, nz, form_factor;
    /// So many of those lit that wait for one each or, of one receiver near to what shines, two for two.
    struct Run {
      std::uint32_t lit, count;
      bool near;
    };
    std::vector<Run> runs;

    void resize(std::size_t count);
    void clear();
  };
  /// Weight of what left the scene, and of what fell on unlit sides, summed over points.
  struct Lost {
    std::uint64_t escaped = 0, absorbed = 0;
    bool operator==(const Lost&) const = default;
  };

  template <typename Take>
  void forEachGroup(std::span<const solver::NodeRun> named, const Take& take) const;
  void weighLostInside(const ViewWindow& window, const solver::HemicubeFrame& point,
                       std::span<const std::uint32_t> items, std::uint32_t resolution, const HemicubeWeights& weights,
                       Lost& lost) const;
  [[nodiscard]] bool addCorners(const solver::GatherShot& shot, std::size_t first, std::size_t end);
  void makeRoom(std::size_t more);
  void clearLit();
  void findLit(const solver::GatherShot& shot);
  void findLitGroup(const solver::GatherShot& shot, const Receivers::Group& group);
  void addPlain(const solver::GatherShot& shot, std::size_t first, std::size_t count, const glm::vec3& normal);
  void weighWhole(const solver::GatherShot& shot);
  void shareAmongPlaces(std::size_t begin);
  /// Room for the places that match so many of those lit, from `lit` on: where they begin. All in one plane.
  std::size_t addOthers(std::size_t lit, std::size_t count, bool near, const glm::vec3& normal);
  template <typename Weigh>
  void leanOnOthers(const Weigh& weigh);
  [[nodiscard]] bool behind(const solver::GatherShot& shot, const scene::Surface& surface) const;
  void testPoint(const solver::GatherShot& shot, const solver::HemicubeFrame& point,
                 std::span<const std::uint32_t> items, std::size_t half);
  void settleEvenGaps(std::span<const std::uint32_t> items, std::size_t size);
  [[nodiscard]] std::array<std::uint32_t, 9> itemsAround(std::size_t i, std::span<const std::uint32_t> items,
                                                         std::size_t size) const;
  [[nodiscard]] Receivers::Ray rayTo(std::size_t i, const glm::vec3& light, std::size_t size) const;
  [[nodiscard]] bool hidden(std::size_t i, const glm::vec3& light, std::span<const std::uint32_t> items,
                            std::size_t size) const;
  [[nodiscard]] bool hiddenFromGap(std::size_t i, const glm::vec3& light, std::span<const std::uint32_t> items,
                                   std::size_t size) const;
  [[nodiscard]] bool hiddenAtSilhouette(std::size_t i, const glm::vec3& light, std::span<const std::uint32_t> items,
                                        std::size_t size) const;
  void weighLost(const solver::HemicubeFrame& point, std::span<const std::uint32_t> items, std::uint32_t resolution,
                 const HemicubeWeights& weights, Lost& lost);
  void beginSums();
  void askRays(const solver::GatherShot& shot, const solver::HemicubeFrame& point, std::uint32_t look,
               std::size_t half);
  void loseByRays(const solver::HemicubeFrame& point, Lost& lost) const;
  void deliverSums(const solver::GatherShot& shot, std::size_t points, const std::array<Lost, 2>& lost,
                   double flux_scale, const FluxSink& sink, solver::TransportCounters& counters);
  void findVisibility(std::size_t sums, std::size_t points);
  [[nodiscard]] double delivered() const;
  [[nodiscard]] double conserve(double area, double kept) const;
  void weighPart(const solver::GatherShot& shot, std::size_t lit, double front);
  void weighClipped(const solver::GatherShot& shot, const ClippedPolygon& polygon, const glm::vec3& normal,
                    std::size_t begin);
  /// Whether this one of those lit, before whose plane the part `front` of the polygon lies, looks for itself. Not
  /// where light passes through surfaces, which rays do not.
  [[nodiscard]] bool isEdge(const solver::GatherShot& shot, std::size_t lit, double front) const;
  /// It does, at the last of parts_.
  void addEdge(std::size_t lit);
  void clearEdges();
  /// How much of the leaf that `place` on the polygon lies in shines, there.
  [[nodiscard]] double shiningAt(const solver::GatherShot& shot, const glm::vec3& place, const glm::vec3& at,
                                 const glm::vec3& normal) const;
  void beginEdges();
  void lookFromEdges(const solver::GatherShot& shot, const solver::HemicubeFrame& point, std::size_t half);
  void takeEdges(std::size_t half, std::size_t points);
  void addLit(const Receivers::Receiver& receiver, const Receivers::Place& place, const glm::vec3& normal);
  void deliver(const solver::GatherShot& shot, std::size_t half, double share, const FluxSink& sink,
               solver::TransportCounters& counters) const;

  std::shared_ptr<const Receivers> receivers_;
  /// A receiver that looks for itself, and how often it saw the light, in either half.
  struct Edge {
    std::uint32_t lit, part;
    std::array<float, 2> seen;
  };

  solver::GatherShot lit_for_;  ///< what lit_ was made for
  bool lit_valid_ = false;
  Lit lit_;
  Others others_;
  std::size_t lit_count_ = 0;
  std::vector<Edge> edges_;                   ///< of what is lit
  std::vector<ClippedPolygon> parts_;         ///< of the polygon, before their planes
  std::vector<std::uint8_t> along_, uneven_;  ///< of the look under way, by pixel
  std::size_t gaps_ = 0;                      ///< of those lit, how many lie in gaps
  std::size_t weighed_ = 0;                   ///< of those lit: the others wait for their form factors
  Lost look_lost_;                            ///< of the looks since beginLinks
  std::uint32_t look_count_ = 0;
  /// Of the look that is being made by rays: so many receivers, and edges, are through with it.
  struct {
    std::uint32_t receivers = 0, edges = 0;
  } asked_;
  solver::Looks open_looks_;  ///< likewise: of them those that lost something
  std::vector<std::uint32_t> starts_;
  std::vector<glm::vec3> places_;  ///< of wanted receivers
  float pixels_around_ = 0.0F;     ///< that they want drawn around these
};

}  // namespace radiosity::gpu
