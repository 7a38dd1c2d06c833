// Grids of probes to JSON and bytes, and their places back.
#include <fmt/format.h>
#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <utility>

#include "common/task.h"
#include "protocol/json_rpc.h"
#include "protocol/json_text.h"
#include "protocol/message_parts.h"
#include "protocol/probes.h"

namespace radiosity::protocol {
namespace {

using nlohmann::json;

constexpr double kAny = std::numeric_limits<double>::max();
constexpr std::uint32_t kBinaryVersion = 1;
/// Before the JSON of a binary file.
constexpr std::size_t kPrefixBytes = 12;
constexpr std::string_view kMagic = "RPRB", kGrids = ",\"grids\":[";
/// Probes between interruption points: a millisecond.
constexpr std::size_t kProbesAtOnce = 4096;
/// Of a number as text, with the comma; most are shorter by some, and few longer.
constexpr std::size_t kUsualDigits = 12;
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

/// The last list tells which.
std::size_t measuredOf(const ProbeGrid& grid) {
  std::size_t measured = 0;
  for (std::size_t i = kProbeNumbers; i <= grid.values.size(); i += kProbeNumbers)
    measured += grid.values[i - 1] == 0.0F ? 1 : 0;
  return measured;
}

json headOf(const Probes& probes) {
  json head = {{"revision", probes.revision}, {"state", probes.state}, {"error", sixDigits(probes.error)}};
  for (const auto& grid : probes.grids)
    if (!grid.values.empty()) head["measured"].push_back(measuredOf(grid));
  return head;
}

std::size_t numbersOf(const Probes& probes) {
  std::size_t numbers = 0;
  for (const auto& grid : probes.grids) numbers += grid.values.size();
  return numbers;
}

void append(Bytes& bytes, std::string_view text) { bytes.insert(bytes.end(), text.begin(), text.end()); }

/// JSON knows no others.
float finite(float value) {
  constexpr float kMost = std::numeric_limits<float>::max();
  return std::isnan(value) ? 0.0F : std::clamp(value, -kMost, kMost);
}

/// Lists are written as text: as values of a JSON library they would take sixteen times the memory.
void appendLists(const ProbeGrid& grid, Bytes& text) {
  std::array<char, 32> digits{};
  std::size_t offset = 0;
  for (const auto& list : kProbeLists) {
    append(text, fmt::format(",\"{}\":[", list.name));
    for (std::size_t probe = 0; probe < grid.values.size() / kProbeNumbers; ++probe) {
      if (probe % kProbesAtOnce == 0) interruptionPoint();
      for (std::size_t i = 0; i < list.count; ++i) {
        const float value = grid.values[probe * kProbeNumbers + offset + i];
        const char* end = fmt::format_to(digits.data(), "{:.6g},", finite(value));
        text.insert(text.end(), static_cast<const char*>(digits.data()), end);
      }
    }
    if (text.back() == ',') text.pop_back();
    append(text, "]");
    offset += list.count;
  }
}

/// A JSON object without its last brace.
std::string opened(const json& object) {
  auto text = dumpJson(object);
  text.pop_back();
  return text;
}

void appendNumber(Bytes& bytes, std::uint32_t number) {
  for (unsigned shift = 0; shift < 32; shift += 8) bytes.push_back(static_cast<std::uint8_t>(number >> shift & 0xFFU));
}

std::uint32_t numberAt(std::string_view bytes, std::size_t at) {
  std::uint32_t number = 0;
  for (std::size_t i = 4; i-- > 0;) number = number << 8U | static_cast<std::uint8_t>(bytes[at + i]);
  return number;
}

void appendValues(const ProbeGrid& grid, Bytes& bytes) {
  constexpr std::size_t kAtOnce = kProbesAtOnce * kProbeNumbers;
  for (std::size_t i = 0; i < grid.values.size(); ++i) {
    if (i % kAtOnce == 0) interruptionPoint();
    appendNumber(bytes, std::bit_cast<std::uint32_t>(finite(grid.values[i])));
  }
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
  for (std::size_t axis = 0; axis < 3; ++axis) {
    grid.counts[axis] = static_cast<std::uint64_t>(counts[axis]);
    if (!r.failed() && static_cast<double>(grid.counts[axis]) != counts[axis])
      r.refuse(r.pointerOf("counts"), "must be three whole numbers");
  }
  readTriple(r, "first", Need::kRequired, -kAny, kAny, grid.first);
  readTriples(r, "steps", grid.steps);
}

}  // namespace

Bytes encodeHttpProbes(const Probes& probes) {
  Bytes text;
  const auto numbers = numbersOf(probes);
  text.reserve(kMaxTextBytes + numbers * kUsualDigits);
  append(text, opened(headOf(probes)));
  append(text, kGrids);
  for (std::size_t g = 0; g < probes.grids.size(); ++g) {
    const auto& grid = probes.grids[g];
    append(text, (g > 0 ? "," : "") + opened(placesOf(grid)));
    if (!grid.values.empty()) appendLists(grid, text);
    append(text, "}");
  }
  append(text, "]}");
  return text;
}

Bytes probesBinary(const Probes& probes) {
  auto head = headOf(probes);
  head["grids"] = json::array();
  for (const auto& grid : probes.grids) head["grids"].push_back(placesOf(grid));
  auto text = dumpJson(head);
  text.resize((text.size() + 3) / 4 * 4, ' ');
  Bytes bytes;
  bytes.reserve(kPrefixBytes + text.size() + sizeof(float) * numbersOf(probes));
  append(bytes, kMagic);
  appendNumber(bytes, kBinaryVersion);
  appendNumber(bytes, static_cast<std::uint32_t>(text.size()));
  append(bytes, text);
  for (const auto& grid : probes.grids) appendValues(grid, bytes);
  return bytes;
}

Result<ProbesHead> decodeProbesHead(std::string_view start) {
  std::string text;
  if (start.starts_with(kMagic) && start.size() >= kPrefixBytes) {
    text = start.substr(kPrefixBytes, numberAt(start, 8));
  } else if (const auto end = start.find(kGrids); end != std::string_view::npos) {
    text = std::string(start.substr(0, end)) + "}";
  }
  return parseJson(text).and_then([](const JsonPtr& value) -> Result<ProbesHead> {
    Reader r(value.get(), "");
    ProbesHead head;
    r.integer("revision", head.revision, Need::kRequired, 0, kAnyInteger);
    r.array("measured", Need::kRequired, kMaxProbeGrids, [&](const json& element, const std::string& pointer) {
      if (element.is_number_unsigned()) return head.measured.push_back(element.get<std::uint64_t>());
      r.refuse(pointer, "must be a number of probes");
    });
    if (r.failed()) return fail(ErrorCode::kBadInput, r.message(), r.pointer());
    return head;
  });
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
