// The engine's values as protocol messages, and its errors as HTTP. Pure functions.
#pragma once

#include <string_view>

#include "protocol/light_web.h"
#include "protocol/messages.h"
#include "protocol/probes.h"
#include "server/engine/engine.h"

namespace radiosity::net {

[[nodiscard]] std::string_view stateName(engine::SolveState state);
[[nodiscard]] protocol::Progress toProgress(const engine::Status& status);
/// As many of the first as a message has room for.
[[nodiscard]] std::vector<std::string> firstWarnings(const std::vector<std::string>& all);
/// The newest `limit` revisions.
[[nodiscard]] protocol::SceneHistoryReply toHistoryReply(const engine::HistoryReport& report, std::uint64_t limit);
[[nodiscard]] protocol::SolveHistoryReply toSolveHistoryReply(const engine::SolveHistory& history);
[[nodiscard]] protocol::TexelReply toTexelReply(const engine::Texel& texel);
[[nodiscard]] protocol::Planes toPlanes(const engine::MeasureReport& report);
[[nodiscard]] protocol::Probes toProbes(engine::ProbeReport report);
[[nodiscard]] protocol::Web toWeb(const engine::ShownWeb& web);
/// What a message has room for.
[[nodiscard]] protocol::Planes withoutLongGrids(protocol::Planes planes);
[[nodiscard]] protocol::StatusReply toStatusReply(const engine::Status& status);
[[nodiscard]] protocol::Settings toSettings(const engine::SolveSettings& settings);
/// `current` with what the call names replaced.
[[nodiscard]] engine::SolveSettings merged(engine::SolveSettings current, const protocol::SolveConfigureCall& call);
[[nodiscard]] protocol::LightmapsNote toLightmapsNote(const engine::Lightmaps& lightmaps);

[[nodiscard]] protocol::Quantity toQuantity(engine::Quantity quantity);
[[nodiscard]] engine::Quantity toQuantity(protocol::Quantity quantity);

/// True when the solve will not come nearer its target without a call.
[[nodiscard]] bool hasStopped(engine::SolveState state);

}  // namespace radiosity::net
