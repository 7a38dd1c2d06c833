#include "tests/benchmark/viewer_swarm.h"

#include <arpa/inet.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <nlohmann/json.hpp>
#include <stdexcept>

namespace radiosity::benchmark {
namespace {

constexpr std::int64_t kCreditStep = 256 * 1024;  ///< given back at a time, as README.md of the protocol proposes

}  // namespace

struct Swarm::Viewer {
  int socket = -1;
  bool upgraded = false, subscribed = false;
  std::string in, out;
  std::int64_t owed = 0;  ///< credit to be given back
  ViewerRecord record;
};

Swarm::Swarm(std::uint16_t port) : port_(port) {}
Swarm::~Swarm() { closeAll(); }

void Swarm::closeAll() {
  for (const auto& viewer : viewers_)
    if (viewer->socket >= 0) ::close(viewer->socket);
  viewers_.clear();
}

void Swarm::add(int count, bool reads) {
  for (int i = 0; i < count; ++i) {
    auto viewer = std::make_unique<Viewer>();
    viewer->record.started = Clock::now();
    viewer->record.reads = reads;
    viewer->socket = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const int small = 4096, yes = 1;
    if (!reads) (void)::setsockopt(viewer->socket, SOL_SOCKET, SO_RCVBUF, &small, sizeof small);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_port = htons(port_);
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    if (::connect(viewer->socket, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
      throw std::runtime_error("cannot connect to the server");
    (void)::setsockopt(viewer->socket, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes);
    (void)::fcntl(viewer->socket, F_SETFL, O_NONBLOCK);
    viewer->out =
        "GET /ws HTTP/1.1\r\nHost: 127.0.0.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Protocol: radiosity.v1\r\n\r\n";
    viewers_.push_back(std::move(viewer));
  }
}

/// A text frame, masked with zeros.
void Swarm::send(Viewer& viewer, const std::string& text) {
  viewer.out += static_cast<char>(0x81);
  if (text.size() < 126) {
    viewer.out += static_cast<char>(0x80U | text.size());
  } else {
    viewer.out += static_cast<char>(0x80U | 126U);
    viewer.out += static_cast<char>(text.size() >> 8U);
    viewer.out += static_cast<char>(text.size() & 255U);
  }
  viewer.out.append(4, '\0');
  viewer.out += text;
}

void Swarm::onText(Viewer& viewer, const std::string& text) {
  const auto message = nlohmann::json::parse(text);
  const std::string method = message.value("method", "");
  if (method == "serverInfo") {
    send(viewer, R"({"jsonrpc":"2.0","id":1,"method":"hello","params":{"client":"benchmark"}})");
    send(viewer, R"({"jsonrpc":"2.0","id":2,"method":"subscribe"})");
    viewer.subscribed = true;
  } else if (method == "bookmark") {
    viewer.record.bookmarks.emplace(message["params"]["tileVersion"], Clock::now());
  } else if (method == "lightmaps") {
    viewer.record.crc.clear();
  } else if (method == "progress") {
    viewer.record.state = message["params"]["state"];
  } else if (message.contains("error")) {
    throw std::runtime_error("the server answered " + text);
  }
}

void Swarm::onTile(Viewer& viewer, std::span<const std::uint8_t> frame) {
  if (!viewer.record.first_tile) viewer.record.first_tile = Clock::now();
  const auto tile = protocol::decodeTile(frame);  // checks the CRC
  if (!tile) throw std::runtime_error(tile.error().text());
  const auto& h = tile->header;
  viewer.record.crc[{h.page, h.mip, h.x, h.y}] = h.crc32c;
  viewer.record.tile_bytes += frame.size();
  viewer.owed += static_cast<std::int64_t>(frame.size());
  if (viewer.owed < kCreditStep) return;
  send(viewer, fmt::format(R"({{"jsonrpc":"2.0","method":"credit","params":{{"bytes":{}}}}})", viewer.owed));
  viewer.owed = 0;
}

void Swarm::onFrame(Viewer& viewer, unsigned opcode, std::span<const std::uint8_t> payload) {
  if (opcode == 1) return onText(viewer, {payload.begin(), payload.end()});
  if (opcode == 2) return onTile(viewer, payload);
  if (opcode == 8) viewer.record.ended = true;
  if (opcode == 9) {
    viewer.out += static_cast<char>(0x8a);
    viewer.out += static_cast<char>(0x80U | payload.size());
    viewer.out.append(4, '\0');
    viewer.out.append(payload.begin(), payload.end());
  }
}

/// Every whole frame that has come.
void Swarm::take(Viewer& viewer) {
  std::size_t at = 0;
  if (!viewer.upgraded) {
    const auto end = viewer.in.find("\r\n\r\n");
    if (end == std::string::npos) return;
    if (!viewer.in.starts_with("HTTP/1.1 101")) throw std::runtime_error(viewer.in.substr(0, end));
    viewer.upgraded = true;
    at = end + 4;
  }
  const auto byte = [&](std::size_t i) { return static_cast<std::uint8_t>(viewer.in[i]); };
  while (viewer.in.size() >= at + 2) {
    std::size_t length = byte(at + 1), head = 2;
    const std::size_t more = length == 126 ? 2 : length == 127 ? 8 : 0;
    if (viewer.in.size() < at + 2 + more) break;
    if (more > 0) length = 0;
    for (std::size_t i = 0; i < more; ++i) length = length << 8U | byte(at + head++);
    if (viewer.in.size() < at + head + length) break;
    const auto* payload = reinterpret_cast<const std::uint8_t*>(viewer.in.data()) + at + head;
    onFrame(viewer, byte(at) & 15U, {payload, length});
    at += head + length;
  }
  viewer.in.erase(0, at);
}

void Swarm::service(Viewer& viewer) {
  std::array<char, 65536> chunk{};
  const bool listens = viewer.record.reads || !viewer.subscribed;
  for (int i = 0; listens && i < 4; ++i) {  // then the others have their turn
    const auto n = ::recv(viewer.socket, chunk.data(), chunk.size(), 0);
    if (n == 0 || (n < 0 && errno != EAGAIN)) viewer.record.ended = true;
    if (n <= 0) break;
    viewer.in.append(chunk.data(), static_cast<std::size_t>(n));
    take(viewer);
    if (n < static_cast<std::ptrdiff_t>(chunk.size())) break;
  }
  if (viewer.out.empty()) return;
  const auto n = ::send(viewer.socket, viewer.out.data(), viewer.out.size(), MSG_NOSIGNAL);
  if (n > 0) viewer.out.erase(0, static_cast<std::size_t>(n));
}

bool Swarm::run(const std::function<bool()>& done, std::chrono::seconds limit) {
  const auto end = Clock::now() + limit;
  while (!done()) {
    if (Clock::now() > end) return false;
    std::vector<pollfd> ready;
    for (const auto& viewer : viewers_) {
      const bool listens = viewer->record.reads || !viewer->subscribed;
      const auto events = static_cast<short>((listens ? POLLIN : 0) | (viewer->out.empty() ? 0 : POLLOUT));
      ready.push_back({viewer->record.ended ? -1 : viewer->socket, events, 0});
    }
    if (::poll(ready.data(), ready.size(), 20) < 0) continue;
    for (std::size_t i = 0; i < ready.size(); ++i)
      if (ready[i].revents != 0) service(*viewers_[i]);
    for (const auto& viewer : viewers_)
      if (viewer->record.reads && viewer->record.ended)
        throw std::runtime_error("the server closed a viewer that reads");
  }
  return true;
}

std::vector<const ViewerRecord*> Swarm::records() const {
  std::vector<const ViewerRecord*> all;
  for (const auto& viewer : viewers_) all.push_back(&viewer->record);
  return all;
}

bool Swarm::allHave(std::uint64_t version) const {
  for (const auto& viewer : viewers_) {
    const auto& r = viewer->record;
    if (r.reads && (r.bookmarks.empty() || r.bookmarks.rbegin()->first < version)) return false;
  }
  return true;
}

}  // namespace radiosity::benchmark
