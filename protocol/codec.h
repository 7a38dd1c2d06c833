// Typed messages to JSON text and back. Decoders check every member they know (kind, range, length), name the JSON
// pointer of what is wrong, and ignore members they do not know. Pure functions; any thread.
#pragma once

#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "protocol/json_rpc.h"
#include "protocol/messages.h"

namespace radiosity::protocol {

// ---- server's side ----

/// The call with its parameters, or the error to answer: kMethodNotFound, or kInvalidParams with pointer and reason
/// ("/params/targetError must be a number in (0, 1]").
[[nodiscard]] tl::expected<Call, RpcError> decodeCall(const RpcRequest& request);

/// Of every method there is, in no particular order.
[[nodiscard]] std::vector<std::string> methodNames();

[[nodiscard]] std::string encodeReply(const RequestId& id, const HelloReply& reply);
[[nodiscard]] std::string encodeReply(const RequestId& id, const SceneGetReply& reply);
[[nodiscard]] std::string encodeReply(const RequestId& id, const SceneLoadReply& reply);
[[nodiscard]] std::string encodeReply(const RequestId& id, const ScenePatchReply& reply);
[[nodiscard]] std::string encodeReply(const RequestId& id, const SceneStepReply& reply);
[[nodiscard]] std::string encodeReply(const RequestId& id, const SceneHistoryReply& reply);
[[nodiscard]] std::string encodeReply(const RequestId& id, const Settings& reply);
[[nodiscard]] std::string encodeReply(const RequestId& id, const StateReply& reply);
[[nodiscard]] std::string encodeReply(const RequestId& id, const StatusReply& reply);
[[nodiscard]] std::string encodeReply(const RequestId& id, const SubscribeReply& reply);
[[nodiscard]] std::string encodeReply(const RequestId& id, const CreditReply& reply);
[[nodiscard]] std::string encodeReply(const RequestId& id, const SnapshotReply& reply);
[[nodiscard]] std::string encodeReply(const RequestId& id, const SolveHistoryReply& reply);
[[nodiscard]] std::string encodeReply(const RequestId& id, const TexelReply& reply);
[[nodiscard]] std::string encodeReply(const RequestId& id, const Planes& reply);
[[nodiscard]] std::string encodeReply(const RequestId& id, const ViewersReply& reply);
[[nodiscard]] std::string encodeReply(const RequestId& id, const CameraReply& reply);

[[nodiscard]] std::string encodeNotification(const Notification& notification);

// ---- client's side ----

/// `id` as JSON text; empty: a notification (sensible for credit only).
[[nodiscard]] std::string encodeCall(const RequestId& id, const Call& call);

/// kMethodNotFound for a notification of a newer minor version, which a client ignores.
[[nodiscard]] tl::expected<Notification, RpcError> decodeNotification(const RpcRequest& request);

/// The `result` of a response as the reply of the call that was made, e.g. decodeReply<StatusReply>(*response.result).
/// kBadInput with the pointer. Defined for every reply type above.
template <typename Reply>
[[nodiscard]] Result<Reply> decodeReply(const nlohmann::json& result);

}  // namespace radiosity::protocol
