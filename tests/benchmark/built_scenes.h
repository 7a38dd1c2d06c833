// What the benchmarks share: the built-in scenes as the server sees them, and ways to carry light. One thread.
#pragma once

#include <benchmark/benchmark.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "server/scene/charts/build.h"
#include "server/scene/values/patch_scene.h"
#include "server/solver/transport/transport.h"

namespace radiosity::benchmarks {

/// First argument of the benchmarks that work on real scenes.
enum BuiltScene : std::int64_t { kCornell, kSmallRoom, kSeminarRoom, kFurnace };
inline constexpr const char* kSceneNames[] = {"cornell", "room_small", "room_seminar", "furnace"};

/// Imported; a benchmark of the import makes its own.
[[nodiscard]] const scene::Scene& importedScene(std::int64_t which);

struct Patches {
  std::shared_ptr<const scene::PatchScene> patches;
  scene::PatchMaterials materials;
};
/// With the patch counts of the paper's rooms, about (default options for the others). Kept for the whole program.
[[nodiscard]] const Patches& patchesOf(std::int64_t which);
[[nodiscard]] scene::ChartOptions chartOptions(std::int64_t which);

/// A room full of small boxes, of about so many rectangles and about as many patches as the paper has for that. Kept
/// for the whole program.
[[nodiscard]] std::shared_ptr<const scene::PatchScene> roomOf(std::int64_t polygons);

/// A closed room, in which so many triangles that shine on both sides hang at random, of the same area in all whatever
/// their number, on about 24,000 patches. Kept for the whole program.
[[nodiscard]] const Patches& lampsOf(std::int64_t lamps);

/// 0 workers: in this process. Null after a failure, with which the state is skipped.
[[nodiscard]] std::unique_ptr<solver::Transport> makeTransport(std::int64_t workers, benchmark::State& state);

/// 0, 1, 2, 4 ... up to the number of cores, that number included.
[[nodiscard]] std::vector<std::int64_t> workerCounts();

/// Bytes the program has from malloc now.
[[nodiscard]] std::size_t heapBytes();

}  // namespace radiosity::benchmarks
