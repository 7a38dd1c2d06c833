#include "protocol/json_rpc.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <utility>

#include "protocol/codec.h"
#include "protocol/limits.h"

namespace radiosity::protocol {
namespace {

RpcMessage parse(std::string_view text) { return parseRpc(text, kMaxMessageBytes); }
RpcError errorOf(std::string_view text) { return std::get<RpcMalformed>(parse(text).items.at(0)).error; }
RpcRequest requestOf(std::string_view text) { return std::get<RpcRequest>(parse(text).items.at(0)); }

RpcError paramsError(std::string_view method, std::string_view params) {
  const auto call = decodeCall(requestOf(R"({"jsonrpc":"2.0","id":1,"method":")" + std::string(method) +
                                         R"(","params":)" + std::string(params) + "}"));
  EXPECT_FALSE(call.has_value()) << method << params;
  return call ? RpcError{} : call.error();
}

// The examples of the JSON-RPC 2.0 specification, section 7.
TEST(JsonRpcSpecification, PositionalAndNamedParameters) {
  const auto positional = requestOf(R"({"jsonrpc": "2.0", "method": "subtract", "params": [42, 23], "id": 1})");
  EXPECT_EQ(positional.method, "subtract");
  EXPECT_EQ(positional.id, "1");
  EXPECT_TRUE(positional.params->is_array());
  const auto named =
      requestOf(R"({"jsonrpc": "2.0", "method": "subtract", "params": {"subtrahend": 23, "minuend": 42}, "id": 3})");
  EXPECT_EQ(named.params->at("minuend"), 42);
}
TEST(JsonRpcSpecification, ANotificationHasNoId) {
  EXPECT_EQ(requestOf(R"({"jsonrpc": "2.0", "method": "update", "params": [1,2,3,4,5]})").id, "");
}
TEST(JsonRpcSpecification, AnUnknownMethodIsNotFound) {
  const auto call = decodeCall(requestOf(R"({"jsonrpc": "2.0", "method": "foobar", "id": "1"})"));
  ASSERT_FALSE(call.has_value());
  EXPECT_EQ(call.error().code, RpcCode::kMethodNotFound);
}
TEST(JsonRpcSpecification, InvalidJsonIsAParseError) {
  EXPECT_EQ(errorOf(R"({"jsonrpc": "2.0", "method": "foobar, "params": "bar", "baz])").code, RpcCode::kParseError);
  EXPECT_EQ(errorOf(R"([{"jsonrpc": "2.0", "method": "sum", "params": [1,2,4], "id": "1"},
                        {"jsonrpc": "2.0", "method"])")
                .code,
            RpcCode::kParseError);
}
TEST(JsonRpcSpecification, AnInvalidRequestObjectIsRefused) {
  EXPECT_EQ(errorOf(R"({"jsonrpc": "2.0", "method": 1, "params": "bar"})").code, RpcCode::kInvalidRequest);
  EXPECT_EQ(errorOf("[]").code, RpcCode::kInvalidRequest);
  EXPECT_FALSE(parse("[]").batch) << "an empty batch is answered with a single object";
  EXPECT_EQ(errorOf("[1]").code, RpcCode::kInvalidRequest);
  EXPECT_EQ(parse("[1,2,3]").items.size(), 3U);
}
TEST(JsonRpcSpecification, ABatchIsTakenApart) {
  const auto message = parse(R"([{"jsonrpc": "2.0", "method": "sum", "params": [1,2,4], "id": "1"},
      {"jsonrpc": "2.0", "method": "notify_hello", "params": [7]},
      {"jsonrpc": "2.0", "method": "subtract", "params": [42,23], "id": "2"}, {"foo": "boo"},
      {"jsonrpc": "2.0", "method": "foo.get", "params": {"name": "myself"}, "id": "5"},
      {"jsonrpc": "2.0", "method": "get_data", "id": "9"}])");
  EXPECT_TRUE(message.batch);
  ASSERT_EQ(message.items.size(), 6U);
  EXPECT_EQ(std::get<RpcRequest>(message.items[0]).id, "\"1\"");
  EXPECT_EQ(std::get<RpcRequest>(message.items[1]).id, "");
  EXPECT_EQ(std::get<RpcMalformed>(message.items[3]).id, "null");
  EXPECT_EQ(encodeBatch({"{}", "1"}), "[{},1]");
}

TEST(JsonRpc, EveryIdComesBackAsItWas) {
  for (const auto* id : {"7", "-1", "1.5", "\"a\\\"b\"", "null", "18446744073709551615"}) {
    const auto request = requestOf(std::string(R"({"jsonrpc":"2.0","method":"status","id":)") + id + "}");
    EXPECT_EQ(request.id, id);
  }
  EXPECT_EQ(errorOf(R"({"jsonrpc":"2.0","method":"status","id":{}})").pointer, "/id");
  EXPECT_EQ(errorOf(R"({"jsonrpc":"2.0","method":"status","id":")" + std::string(300, 'x') + "\"}").pointer, "/id");
}

TEST(JsonRpc, DepthIsCheckedBeforeParsing) {
  const auto nested = [](std::size_t depth) { return std::string(depth, '[') + std::string(depth, ']'); };
  EXPECT_FALSE(isDeeperThan(nested(64), 64));
  EXPECT_TRUE(isDeeperThan(nested(65), 64));
  EXPECT_FALSE(isDeeperThan(R"(["[[[\"[[["])", 1)) << "brackets in strings do not nest";
  EXPECT_TRUE(parseJson(nested(64)).has_value());
  EXPECT_FALSE(parseJson(nested(65)).has_value());
  EXPECT_EQ(errorOf(std::string(100'000, '[')).code, RpcCode::kParseError);
  EXPECT_EQ(errorOf(std::string(100'000, '{')).code, RpcCode::kParseError);
}

TEST(JsonRpc, AMessageOverTheLimitIsNotParsed) {
  EXPECT_EQ(errorOf("\"" + std::string(kMaxMessageBytes, 'a') + "\"").code, RpcCode::kTooLarge);
}

TEST(JsonRpc, WhatIsWrongIsSaidInFewWordsHoweverLongTheToken) {
  const auto error = errorOf("\"" + std::string(kMaxMessageBytes - 1, 'a'));
  EXPECT_EQ(error.code, RpcCode::kParseError);
  EXPECT_LT(error.message.size(), 400U);
  EXPECT_NE(error.message.find("missing closing quote"), std::string::npos) << error.message;
}

TEST(JsonRpc, ErrorsKeepTheirPlaceAcrossTheWire) {
  const RpcError error{RpcCode::kInvalidScene, "no such \"texture\"", "/materials/3", 2, 17};
  const auto message = parse(encodeError("5", error));
  const auto& response = std::get<RpcResponse>(message.items.at(0));
  EXPECT_EQ(response.id, "5");
  EXPECT_EQ(response.error->code, error.code);
  EXPECT_EQ(response.error->message, error.message);
  EXPECT_EQ(response.error->pointer, error.pointer);
  EXPECT_EQ(response.error->op, 2U);
  EXPECT_EQ(response.error->revision, 17U);
  EXPECT_EQ(fromRpcError(error).code, ErrorCode::kInvalidScene);
  EXPECT_EQ(toRpcError({ErrorCode::kStaleRevision, "m", "w"}).code, RpcCode::kStaleRevision);
}

TEST(JsonRpc, EveryErrorOfTheServerHasItsCode) {
  const std::pair<ErrorCode, RpcCode> codes[] = {{ErrorCode::kBadUsage, RpcCode::kInvalidParams},
                                                 {ErrorCode::kBadInput, RpcCode::kInvalidScene},
                                                 {ErrorCode::kInvalidScene, RpcCode::kInvalidScene},
                                                 {ErrorCode::kUnsupported, RpcCode::kInvalidScene},
                                                 {ErrorCode::kNotFound, RpcCode::kNotFound},
                                                 {ErrorCode::kTooLarge, RpcCode::kTooLarge},
                                                 {ErrorCode::kStaleRevision, RpcCode::kStaleRevision},
                                                 {ErrorCode::kTestFailed, RpcCode::kTestFailed},
                                                 {ErrorCode::kBusy, RpcCode::kRateLimited},
                                                 {ErrorCode::kUnavailable, RpcCode::kUnavailable},
                                                 {ErrorCode::kCancelled, RpcCode::kCancelled},
                                                 {ErrorCode::kInternal, RpcCode::kInternalError}};
  for (const auto& [ours, wire] : codes) EXPECT_EQ(toRpcError({ours, "what was wrong", {}}).code, wire);
}

TEST(Params, AnErrorNamesThePointerAndTheRange) {
  EXPECT_EQ(paramsError("solve.configure", R"({"targetError":0})").message,
            "/params/targetError must be a number in (0, 1]");
  EXPECT_EQ(paramsError("solve.configure", R"({"targetError":"x"})").pointer, "/params/targetError");
  EXPECT_EQ(paramsError("solve.configure", R"({"targetError":1.5})").pointer, "/params/targetError");
  EXPECT_EQ(paramsError("solve.configure", R"([1])").pointer, "/params");
  EXPECT_EQ(paramsError("solve.configure", R"({"method":"magic"})").message,
            "/params/method must be one of gather, shooting, paper");
  EXPECT_EQ(paramsError("hello", "{}").message, "/params/client is missing");
  EXPECT_EQ(paramsError("hello", R"({"client":"x","resume":{"epoch":"e"}})").pointer, "/params/resume/revision");
  EXPECT_EQ(paramsError("hello", R"({"client":"x","codecs":[7]})").pointer, "/params/codecs/0");
  EXPECT_EQ(paramsError("subscribe", R"({"minMip":3,"maxMip":2})").pointer, "/params/minMip");
  EXPECT_EQ(paramsError("subscribe", R"({"quantity":"beauty"})").pointer, "/params/quantity");
  EXPECT_EQ(paramsError("credit", R"({"bytes":-1})").pointer, "/params/bytes");
  EXPECT_EQ(paramsError("snapshot", R"({"width":100000})").pointer, "/params/width");
  EXPECT_EQ(paramsError("snapshot", R"({"exposure":0})").message, "/params/exposure must be a number in (0, 1e+30]");
  EXPECT_EQ(paramsError("texel", R"({"x":1,"y":2})").message, "/params/page is missing");
  EXPECT_EQ(paramsError("texel", R"({"page":0,"x":-1,"y":2})").pointer, "/params/x");
  EXPECT_EQ(paramsError("texel", R"({"page":0,"x":1.5,"y":2})").pointer, "/params/x");
  EXPECT_EQ(paramsError("texel", R"({"page":0,"x":1,"y":4294967296})").pointer, "/params/y");
}

TEST(Params, APatchErrorNamesTheOperation) {
  const auto error = paramsError("scene.patch", R"({"patch":[{"op":"add","path":"/a"},{"op":"add"}]})");
  EXPECT_EQ(error.pointer, "/params/patch/1/path");
  EXPECT_EQ(error.op, 1U);
  EXPECT_EQ(paramsError("scene.patch", R"({"patch":{}})").pointer, "/params/patch");
  std::string many = R"({"patch":[)";
  for (int i = 0; i < 5001; ++i) many += std::string(i > 0 ? "," : "") + R"({"op":"add","path":"/a"})";
  EXPECT_EQ(paramsError("scene.patch", many + "]}").pointer, "/params/patch");
}

TEST(Params, UnknownMembersAndNamesAreIgnored) {
  const auto call = decodeCall(requestOf(
      R"({"jsonrpc":"2.0","id":1,"method":"hello","extra":1,"params":{"client":"x","new":[],"tileFormats":["jpegxl","rgb9e5"]}})"));
  ASSERT_TRUE(call.has_value()) << call.error().message;
  EXPECT_THAT(std::get<HelloCall>(*call).tile_formats, testing::ElementsAre(PixelFormat::kRgb9e5));
}

TEST(Params, AWholeNumberWrittenAsAFractionIsAnInteger) {
  const auto call = decodeCall(requestOf(R"({"jsonrpc":"2.0","id":1,"method":"credit","params":{"bytes":5.0}})"));
  ASSERT_TRUE(call.has_value());
  EXPECT_EQ(std::get<CreditCall>(*call).bytes, 5);
  EXPECT_EQ(paramsError("credit", R"({"bytes":5.5})").pointer, "/params/bytes");
}

TEST(JsonTestSuite, AcceptsWhatIsJsonAndRefusesWhatIsNot) {
  const auto folder = std::filesystem::path(RADIOSITY_SHARED_DIR) / "suites/JSONTestSuite/test_parsing";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << folder << " is not there";
  std::size_t count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const auto name = entry.path().filename().string();
    SCOPED_TRACE(name);
    std::ifstream in(entry.path(), std::ios::binary);
    const std::string text(std::istreambuf_iterator<char>(in), {});
    const bool accepted = parseJson(text).has_value();
    const auto message = parse(text);
    EXPECT_FALSE(message.items.empty());
    for (const auto& item : message.items)
      if (const auto* request = std::get_if<RpcRequest>(&item)) {
        EXPECT_FALSE(decodeCall(*request).has_value());
      }
    if (name.starts_with("y_")) {
      EXPECT_TRUE(accepted);
    }
    if (name.starts_with("n_")) {
      EXPECT_FALSE(accepted);
    }
    ++count;
  }
  EXPECT_GT(count, 300U);
}

}  // namespace
}  // namespace radiosity::protocol
