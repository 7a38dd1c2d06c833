// Bytes on a connection to a running server with a fake engine: the first byte says whether they come in place of the
// HTTP request, after the WebSocket handshake, or after hello. The claim: the server is still there for the next one.
#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <string>
#include <thread>

#include "common/log.h"
#include "server/net/server.h"
#include "tests/fuzz/examples.h"
#include "tests/fuzz/target.h"
#include "tests/service/fake_engine.h"

namespace radiosity::fuzz {
namespace {

enum Start : char { kHttp = 'h', kSocket = 's', kViewer = 'v' };

/// Runs for as long as the program; nothing is left to clean up that the system would not.
class LastingServer {
 public:
  LastingServer() {
    net::ServerOptions options;
    options.port = 0;
    options.hello_timeout = options.write_deadline = options.close_patience = options.header_timeout =
        std::chrono::milliseconds(500);
    auto opened = net::Server::open(options, engine_);
    require(opened.has_value(), "the server starts");
    server_ = std::move(*opened);
    engine_.publish();
    thread_ = std::thread([this] { server_->run(); });
    thread_.detach();
  }
  [[nodiscard]] std::uint16_t port() const { return server_->port(); }

 private:
  testing::FakeEngine engine_;
  std::unique_ptr<net::Server> server_;
  std::thread thread_;
};

/// A text frame with a mask of zeros, so that a mutation of its text is one of the text.
std::string textFrame(const std::string& text) {
  std::string frame{'\x81'};
  if (text.size() < 126) {
    frame += static_cast<char>(0x80U | text.size());
  } else {
    frame +=
        {static_cast<char>(0x80U | 126U), static_cast<char>(text.size() >> 8U), static_cast<char>(text.size() & 255U)};
  }
  return frame + std::string(4, '\0') + text;
}

const std::string kUpgrade =
    "GET /ws HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
    "Sec-WebSocket-Protocol: radiosity.v1\r\n\r\n";
const std::string kHello = R"({"jsonrpc":"2.0","id":1,"method":"hello","params":{"client":"fuzz"}})";
const std::string kSubscribe = R"({"jsonrpc":"2.0","id":2,"method":"subscribe","params":{"quantity":"irradiance"}})";

sockaddr_in loopback(std::uint32_t host, std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(port);
  address.sin_addr.s_addr = htonl(host);
  return address;
}

/// -1, with errno set: no connection. Each call comes from the next of 200 addresses: after it, the system keeps the
/// port of who closes first for a minute, and some hundred a second from one address use up all there are.
int connectOnce(std::uint16_t port) {
  static std::uint32_t calls = 0;
  const int socket = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (socket < 0) return -1;
  const int late = 1;  // the port is chosen once it is known where to
  (void)::setsockopt(socket, IPPROTO_IP, IP_BIND_ADDRESS_NO_PORT, &late, sizeof late);
  const auto from = loopback(INADDR_LOOPBACK + 1 + calls++ % 200, 0), to = loopback(INADDR_LOOPBACK, port);
  const auto reached = [socket](auto call, const sockaddr_in& address) {
    return call(socket, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  };
  if (reached(::bind, from) && reached(::connect, to)) return socket;
  const int reason = errno;
  ::close(socket);
  errno = reason;
  return -1;
}

/// Asks again for five seconds, since a machine may be short of something for a moment: a server that is gone stays
/// gone.
int connectTo(std::uint16_t port) {
  const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(5);
  for (;;) {
    const int socket = connectOnce(port);
    if (socket >= 0) return socket;
    std::fprintf(stderr, "no connection to port %d: %s\n", port, std::strerror(errno));
    require(std::chrono::steady_clock::now() < until, "the server is still there");
    std::this_thread::sleep_for(std::chrono::milliseconds(200));
  }
}

/// Sends everything, says that nothing more comes, and reads to the end.
void talk(std::uint16_t port, const std::string& bytes) {
  const int socket = connectTo(port);
  const timeval limit{20, 0};
  (void)::setsockopt(socket, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
  (void)::setsockopt(socket, SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof limit);
  std::size_t sent = 0;
  while (sent < bytes.size()) {
    const auto n = ::send(socket, bytes.data() + sent, bytes.size() - sent, MSG_NOSIGNAL);
    if (n <= 0) break;
    sent += static_cast<std::size_t>(n);
  }
  (void)::shutdown(socket, SHUT_WR);
  std::array<char, 65536> sink{};
  ssize_t got = 0;
  do got = ::recv(socket, sink.data(), sink.size(), 0);
  while (got > 0);
  require(got == 0 || (errno != EAGAIN && errno != EWOULDBLOCK),
          "the server ends a connection that its client has ended");
  ::close(socket);
}

}  // namespace

std::vector<Seed> seeds() {
  const auto of = [](Start start, const std::string& bytes) { return seedOf(std::string(1, start) + bytes); };
  std::vector<Seed> all{
      of(kHttp, "GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n"),
      of(kHttp, "PUT /uploads?name=a.glb HTTP/1.1\r\nHost: localhost\r\nContent-Length: 4\r\n\r\nglTF"),
      of(kHttp, "GET /lightmaps/0.exr?quantity=error HTTP/1.1\r\nHost: localhost\r\n\r\n"),
      of(kHttp, "PUT /scene HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n4\r\nglTF\r\n0\r\n\r\n"),
      of(kHttp,
         "PUT /scene HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: gzip, chunked\r\n\r\n4;a=\"b\"\r\nglTF\r\n0\r\n"
         "X-Trailer: 1\r\n\r\n"),
      of(kHttp, "OPTIONS * HTTP/1.1\r\nHost: localhost\r\n\r\nGET http://localhost/ HTTP/1.1\r\nHost: x\r\n\r\n"),
      of(kHttp, kUpgrade),
      of(kSocket, textFrame(kHello) + textFrame(kSubscribe)),
      of(kViewer, textFrame(kSubscribe)),
      of(kViewer,
         textFrame(
             R"([{"jsonrpc":"2.0","id":3,"method":"status"},{"jsonrpc":"2.0","method":"credit","params":{"bytes":9}}])")),
      of(kViewer, std::string("\x89\x80\0\0\0\0\x88\x82\0\0\0\0\x03\xe8", 14))};
  for (const auto& text : exampleTexts("call-")) all.push_back(of(kViewer, textFrame(text)));
  return all;
}

}  // namespace radiosity::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace radiosity;                        // NOLINT
  static auto* server = new fuzz::LastingServer();  // lasting
  if (size == 0) return 0;
  const auto start = static_cast<char>(data[0]);
  std::string bytes;
  if (start != fuzz::kHttp) bytes += fuzz::kUpgrade;
  if (start == fuzz::kViewer) bytes += fuzz::textFrame(fuzz::kHello);
  bytes.append(reinterpret_cast<const char*>(data) + 1, size - 1);
  fuzz::talk(server->port(), bytes);
  return 0;
}
