// Every file in protocol/examples is decoded and encoded again and must come out the same: the examples in the
// specification cannot drift from the code.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "protocol/codec.h"
#include "protocol/tile_frame.h"

namespace radiosity::protocol {
namespace {

using nlohmann::json;

std::filesystem::path folder() { return std::filesystem::path(RADIOSITY_SOURCE_DIR) / "protocol" / "examples"; }

std::string textOf(const std::filesystem::path& file) {
  std::ifstream in(file);
  return {std::istreambuf_iterator<char>(in), {}};
}

RpcItem itemOf(const std::string& text) { return parseRpc(text, kMaxMessageBytes).items.at(0); }

template <typename Reply>
std::string again(const RpcResponse& response) {
  const auto reply = decodeReply<Reply>(*response.result);
  return reply ? encodeReply(response.id, *reply) : reply.error().text();
}

template <typename... C>
std::map<std::string, std::string (*)(const RpcResponse&)> replyCodecs(std::variant<C...>* /*type only*/) {
  return {{std::string(C::kMethod), &again<typename C::Reply>}...};
}

std::string roundTrip(const std::string& kind, const std::string& name, const std::string& text) {
  const auto item = itemOf(text);
  if (kind == "error") {
    const auto& response = std::get<RpcResponse>(item);
    return encodeError(response.id, *response.error);
  }
  if (kind == "reply") return replyCodecs(static_cast<Call*>(nullptr)).at(name)(std::get<RpcResponse>(item));
  const auto& request = std::get<RpcRequest>(item);
  if (kind == "call") {
    const auto call = decodeCall(request);
    return call ? encodeCall(request.id, *call) : call.error().message;
  }
  const auto note = decodeNotification(request);
  return note ? encodeNotification(*note) : note.error().message;
}

template <typename... M>
std::set<std::string> methodsOf(const std::string& kind, std::variant<M...>* /*type only*/) {
  return {kind + "-" + std::string(M::kMethod)...};
}

TEST(Examples, ComeOutOfTheCodecAsTheyWentIn) {
  std::size_t count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder())) {
    if (entry.path().extension() != ".json") continue;
    SCOPED_TRACE(entry.path().filename().string());
    const auto stem = entry.path().stem().string();
    const auto dash = stem.find('-');
    const auto text = textOf(entry.path());
    const auto out = roundTrip(stem.substr(0, dash), stem.substr(dash + 1), text);
    ASSERT_TRUE(json::accept(out)) << out;
    EXPECT_EQ(json::parse(out), json::parse(text));
    ++count;
  }
  EXPECT_GT(count, 30U);
}

TEST(Examples, CoverEveryMessage) {
  std::set<std::string> wanted = methodsOf("call", static_cast<Call*>(nullptr));
  wanted.merge(methodsOf("reply", static_cast<Call*>(nullptr)));
  wanted.merge(methodsOf("note", static_cast<Notification*>(nullptr)));
  for (const auto& name : wanted) EXPECT_TRUE(std::filesystem::exists(folder() / (name + ".json"))) << name;
}

Bytes frameFromHex() {
  std::istringstream in(textOf(folder() / "tile-frame.hex"));
  Bytes frame;
  for (std::string line; std::getline(in, line);) {
    std::istringstream words(line.substr(0, line.find('#')));
    for (std::string byte; words >> byte;) frame.push_back(static_cast<std::uint8_t>(std::stoi(byte, nullptr, 16)));
  }
  return frame;
}

TEST(Examples, TheTileFrameInHexIsWhatTheEncoderMakes) {
  Image image(2, 1);
  image.at(0, 0) = {1.0F, 0.5F, 0.25F};
  image.at(1, 0) = {100.0F, 0.0F, 65504.0F};
  TileHeader header;
  header.page = 1;
  header.mip = 2;
  header.flags = kTileReset;
  header.x = 64;
  header.y = 128;
  header.revision = 3;
  header.tile_version = 41;
  header.shots = 18250;
  header.error = 0.03125F;
  const auto pixels = encodePixels(image, {0, 0, 2, 1}, PixelFormat::kRgba16f, Codec::kNone);
  ASSERT_TRUE(pixels.has_value());
  const auto encoded = encodeTile(header, *pixels);
  const auto expected = frameFromHex();
  if (encoded != expected)
    for (std::size_t i = 0; i < encoded.size(); ++i) std::printf("%02x%c", encoded[i], i % 16 == 15 ? '\n' : ' ');
  EXPECT_EQ(encoded, expected);
  const auto tile = decodeTile(expected);
  ASSERT_TRUE(tile.has_value()) << tile.error().text();
  EXPECT_EQ(tile->header.tile_version, 41U);
  EXPECT_EQ(tileImage(*tile)->at(0, 0), glm::vec3(1.0F, 0.5F, 0.25F));
}

}  // namespace
}  // namespace radiosity::protocol
