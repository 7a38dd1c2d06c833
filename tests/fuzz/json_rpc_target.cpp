// A text frame, as the server and as a client takes it: calls, notifications and answers of every kind.
#include "protocol/codec.h"
#include "protocol/limits.h"
#include "tests/fuzz/examples.h"
#include "tests/fuzz/target.h"

namespace radiosity::fuzz {

std::vector<Seed> seeds() {
  std::vector<Seed> all{seedOf("[]"), seedOf(R"([{"jsonrpc":"2.0","id":1,"method":"viewers"},5])")};
  for (const auto& text : exampleTexts("")) all.push_back(seedOf(text));
  return all;
}

namespace {

using namespace protocol;  // NOLINT

template <typename... C>
void decodeReplies(const nlohmann::json& result, std::variant<C...>* /*only its type counts*/) {
  (void)(decodeReply<typename C::Reply>(result).has_value() + ...);
}

void take(const RpcItem& item) {
  if (const auto* request = std::get_if<RpcRequest>(&item)) {
    if (const auto call = decodeCall(*request)) {
      const auto text = encodeCall("1", *call);
      const auto again = parseRpc(text, 4 * kMaxMessageBytes);
      const auto* same = std::get_if<RpcRequest>(&again.items.at(0));
      require(same != nullptr && decodeCall(*same).has_value(), "a call that was understood can be sent on");
    }
    (void)decodeNotification(*request);
  } else if (const auto* response = std::get_if<RpcResponse>(&item)) {
    if (response->result) decodeReplies(*response->result, static_cast<Call*>(nullptr));
  } else {
    const auto& malformed = std::get<RpcMalformed>(item);
    require(!encodeError(malformed.id, malformed.error).empty(), "what is wrong can be answered");
  }
}

}  // namespace
}  // namespace radiosity::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace radiosity;  // NOLINT
  const auto message = protocol::parseRpc({reinterpret_cast<const char*>(data), size}, protocol::kMaxMessageBytes);
  fuzz::require(!message.items.empty(), "every frame has something to answer");
  for (const auto& item : message.items) fuzz::take(item);
  return 0;
}
