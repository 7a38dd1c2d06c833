// Grids of probes as files tell them. Plain values; used by the server and the client.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "common/bytes.h"
#include "common/result.h"

namespace radiosity::protocol {

inline constexpr std::size_t kMaxProbeGrids = 64;
inline constexpr std::size_t kMaxProbes = std::size_t{1} << 18U;  ///< of all grids together
inline constexpr double kMaxProbeSpacing = 1.0e6;                 ///< metres

/// Lists of a probe, in the order in which a binary file has them: name, and numbers in it.
struct ProbeList {
  std::string_view name;
  std::size_t count = 0;
};
inline constexpr std::array kProbeLists = {
    ProbeList{"light", 27},  ProbeList{"standardError", 27}, ProbeList{"distance", 6}, ProbeList{"distanceSquared", 6},
    ProbeList{"nearest", 1}, ProbeList{"backs", 1},          ProbeList{"ring", 1}};
inline constexpr std::size_t kProbeNumbers = 69;  ///< of all lists

struct ProbeGrid {
  std::optional<std::uint64_t> node;  ///< none: the whole scene
  std::string name;
  std::array<std::uint64_t, 3> counts{1, 1, 1};
  std::array<double, 3> first{};                 ///< metres
  std::array<std::array<double, 3>, 3> steps{};  ///< to the next in x, y and z
  std::vector<float> values;                     ///< kProbeNumbers a probe; empty: places alone
};

struct Probes {
  std::uint64_t revision = 0;
  std::string state;
  double error = 1.0;  ///< total, as Progress tells it
  std::vector<ProbeGrid> grids;
};

/// {"error", "measured", "revision", "state", "grids"}, in this order; each grid with its lists where it has values,
/// and then `measured` has for each grid how many of its probes were measured themselves. Throws what interrupts the
/// task (task.h), and std::bad_alloc, as the next does.
[[nodiscard]] Bytes encodeHttpProbes(const Probes& probes);
/// The same as bytes: "RPRB", the version 1 and the size of what follows as 32-bit numbers, JSON as of places alone,
/// with spaces at its end, and then, from a multiple of four bytes on, the values of one grid after the other as 32-bit
/// floats; all little-endian.
[[nodiscard]] Bytes probesBinary(const Probes& probes);
/// The grids of encodeHttpProbes(), without their lists.
[[nodiscard]] Result<Probes> decodeHttpProbes(std::string_view body);

/// What is told of all grids, before the first of them.
struct ProbesHead {
  std::uint64_t revision = 0;
  std::vector<std::uint64_t> measured;  ///< probes, by grid
};
inline constexpr std::size_t kMaxProbesHeadBytes = std::size_t{1} << 18U;
/// Of the first kMaxProbesHeadBytes of either form, with light. kBadInput: they are of neither.
[[nodiscard]] Result<ProbesHead> decodeProbesHead(std::string_view start);

}  // namespace radiosity::protocol
