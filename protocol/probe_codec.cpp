// Grids of probes to JSON and bytes, and their places back.
#include <fmt/format.h>
#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>
#include <utility>

#include "protocol/json_rpc.h"
#include "protocol/json_text.h"
#include "protocol/message_parts.h"
#include "protocol/probes.h"

namespace radiosity::protocol {
namespace {

using nlohmann::json;

constexpr double kAny = std::numeric_limits<double>::max();
constexpr std::uint32_t kBinaryVersion = 1;
static_assert([] {
  std::size_t numbers = 0;
  for (const auto& list : kProbeLists) numbers += list.count;
  return numbers == kProbeNumbers;
}());

json placesOf(const ProbeGrid& grid) {
  json out = {{"name", grid.name}, {"counts", grid.counts}, {"first", grid.first}, {"steps", grid.steps}};
  if (grid.node) out["node"] = *grid.node;
  return out;
}

json headOf(const Probes& probes) {
  return {{"revision", probes.revision}, {"state", probes.state}, {"error", sixDigits(probes.error)}};
}

/// JSON knows no others.
float finite(float value) {
  constexpr float kMost = std::numeric_limits<float>::max();
  return std::isnan(value) ? 0.0F : std::clamp(value, -kMost, kMost);
}

/// Lists are written as text: as values of a JSON library they would take sixteen times the memory.
void appendLists(const ProbeGrid& grid, std::string& text) {
  std::size_t offset = 0;
  for (const auto& list : kProbeLists) {
    fmt::format_to(std::back_inserter(text), ",\"{}\":[", list.name);
    for (std::size_t probe = offset; probe < grid.values.size(); probe += kProbeNumbers) {
      for (std::size_t i = 0; i < list.count; ++i)
        fmt::format_to(std::back_inserter(text), "{:.6g},", finite(grid.values[probe + i]));
    }
    if (text.back() == ',') text.pop_back();
    text += "]";
    offset += list.count;
  }
}

/// A JSON object without its last brace.
std::string opened(const json& object) {
  auto text = dumpJson(object);
  text.pop_back();
  return text;
}

void appendNumber(std::string& bytes, std::uint32_t number) {
  for (unsigned shift = 0; shift < 32; shift += 8) bytes.push_back(static_cast<char>(number >> shift & 0xFFU));
}

void readTriples(Reader& r, const char* key, std::array<std::array<double, 3>, 3>& triples) {
  std::size_t count = 0;
  r.array(key, Need::kRequired, triples.size(), [&](const json& element, const std::string& pointer) {
    const json wrapped = {{"of", element}};
    Reader inner(&wrapped, pointer);
    readTriple(inner, "of", Need::kRequired, -kAny, kAny, triples[count++]);
    if (inner.failed()) r.refuse(pointer, "must be three numbers");
  });
  if (!r.failed() && count != triples.size()) r.refuse(r.pointerOf(key), "must have three elements");
}

void read(Reader& r, ProbeGrid& grid) {
  r.optionalInteger("node", grid.node, 0, kAnyInteger);
  r.text("name", grid.name, Need::kOptional, kAnyText);
  std::array<double, 3> counts{};
  readTriple(r, "counts", Need::kRequired, 1.0, static_cast<double>(kMaxProbes), counts);
  for (std::size_t axis = 0; axis < 3; ++axis) grid.counts[axis] = static_cast<std::uint64_t>(counts[axis]);
  readTriple(r, "first", Need::kRequired, -kAny, kAny, grid.first);
  readTriples(r, "steps", grid.steps);
}

}  // namespace

std::string encodeHttpProbes(const Probes& probes) {
  auto text = opened(headOf(probes)) + ",\"grids\":[";
  for (std::size_t g = 0; g < probes.grids.size(); ++g) {
    const auto& grid = probes.grids[g];
    text += (g > 0 ? "," : "") + opened(placesOf(grid));
    if (!grid.values.empty()) appendLists(grid, text);
    text += "}";
  }
  return text + "]}";
}

std::string probesBinary(const Probes& probes) {
  auto head = headOf(probes);
  head["grids"] = json::array();
  std::size_t numbers = 0;
  for (const auto& grid : probes.grids) {
    head["grids"].push_back(placesOf(grid));
    numbers += grid.values.size();
  }
  auto text = dumpJson(head);
  text.resize((text.size() + 3) / 4 * 4, ' ');
  std::string bytes = "RPRB";
  bytes.reserve(12 + text.size() + 4 * numbers);
  appendNumber(bytes, kBinaryVersion);
  appendNumber(bytes, static_cast<std::uint32_t>(text.size()));
  bytes += text;
  for (const auto& grid : probes.grids)
    for (const float value : grid.values) appendNumber(bytes, std::bit_cast<std::uint32_t>(finite(value)));
  return bytes;
}

Result<Probes> decodeHttpProbes(std::string_view body) {
  return parseJson(body).and_then([](const JsonPtr& value) -> Result<Probes> {
    Reader r(value.get(), "");
    Probes probes;
    r.integer("revision", probes.revision, Need::kRequired, 0, kAnyInteger);
    r.text("state", probes.state, Need::kRequired, kMaxTextBytes);
    r.number("error", probes.error, Need::kRequired, {0.0, kAny, false});
    r.array("grids", Need::kRequired, kMaxProbeGrids, [&](const json& element, const std::string& pointer) {
      Reader inner(&element, pointer);
      read(inner, probes.grids.emplace_back());
      if (inner.failed()) r.refuse(inner.pointer(), inner.message().substr(inner.pointer().size() + 1));
    });
    if (r.failed()) return fail(ErrorCode::kBadInput, r.message(), r.pointer());
    return probes;
  });
}

}  // namespace radiosity::protocol
