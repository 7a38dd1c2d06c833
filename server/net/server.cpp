#include "server/net/server.h"

#include <fmt/format.h>
#include <pthread.h>
#include <unistd.h>
#include <atomic>
#include <boost/asio/post.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/steady_timer.hpp>
#include <cerrno>
#include <chrono>
#include <functional>
#include <new>
#include <thread>
#include <utility>
#include <vector>

#include "common/log.h"
#include "server/net/access.h"
#include "server/net/beast.h"
#include "server/net/convert.h"
#include "server/net/http_session.h"
#include "server/net/hub.h"
#include "server/net/tls_handshake.h"

namespace radiosity::net {

using Clock = std::chrono::steady_clock;

class Server::State {
 public:
  State(const ServerOptions& options, engine::Engine& engine)
      : hub_(std::make_shared<Hub>(options, engine)),
        context_(options.threads),
        strand_(asio::make_strand(context_)),
        acceptor_(strand_),
        signals_(strand_),
        drain_timer_(strand_),
        retry_timer_(strand_) {}

  ~State() { hub_->shut(); }  // before the sockets go
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  Result<void> open();
  Result<void> loadCertificate();
  void accept();
  void serve(TcpStream stream, ConnectionSlot slot);
  void watchSignals();
  void readAgain();
  void drain();
  void run();

 private:
  friend class Server;

  void waitForLast();
  void beat();
  void serveEvents();

  std::shared_ptr<Hub> hub_;
  asio::io_context context_;
  Strand strand_;
  asio::basic_socket_acceptor<tcp, Strand> acceptor_;
  asio::basic_signal_set<Strand> signals_;
  asio::basic_waitable_timer<Clock, asio::wait_traits<Clock>, Strand> drain_timer_, retry_timer_;
  std::shared_ptr<TlsContext> tls_;  ///< null: plain; on the strand
  asio::basic_waitable_timer<Clock, asio::wait_traits<Clock>, Strand> beat_timer_{strand_};
  std::atomic<Clock::rep> last_beat_{Clock::now().time_since_epoch().count()};
  std::function<void()> drain_hook_;
  bool signalled_ = false, on_terminal_ = false;
  std::atomic<bool> in_hurry_{false};
  Clock::time_point drain_until_;
  std::uint16_t port_ = 0;
};

Result<void> Server::State::open() {
  const auto& options = hub_->options();
  if (auto safe = checkExposure(options); !safe) return safe;
  if (auto loaded = loadCertificate(); !loaded) return loaded;
  const tcp::endpoint endpoint(asio::ip::make_address(options.address), options.port);
  BoostError error;
  acceptor_.open(endpoint.protocol(), error);
  if (!error) acceptor_.set_option(asio::socket_base::reuse_address(true), error);
  if (!error) acceptor_.bind(endpoint, error);
  if (!error) acceptor_.listen(asio::socket_base::max_listen_connections, error);
  if (!error) port_ = acceptor_.local_endpoint(error).port();
  if (!error) return {};
  const auto* advice =
      error == asio::error::address_in_use ? "; another server is there: choose another --listen port" : "";
  return fail(ErrorCode::kUnavailable, error.message() + advice,
              fmt::format("cannot listen on {}:{}", options.address, options.port));
}

/// Both or neither of the options; connections that stand keep the certificate they began with.
Result<void> Server::State::loadCertificate() {
  const auto& options = hub_->options();
  if (options.tls_certificate.empty() && options.tls_key.empty()) return {};
  if (options.tls_certificate.empty() || options.tls_key.empty())
    return fail(ErrorCode::kBadUsage, "--tls-cert and --tls-key belong together");
  auto tls = loadTls(options.tls_certificate, options.tls_key);
  if (!tls) return tl::unexpected(std::move(tls.error()));
  tls_ = std::move(*tls);
  hub_->counters().certificate_expires_at_s = tls_->expires_at_s;
  return {};
}

void Server::State::serve(TcpStream stream, ConnectionSlot slot) {
  if (tls_) return serveTls(std::move(stream), tls_, hub_, std::move(slot));
  serveHttp(Stream(std::move(stream)), hub_, std::move(slot));
}

void Server::State::accept() {
  acceptor_.async_accept(asio::make_strand(context_), [this](BoostError error, auto socket) {
    // Closed by the drain, perhaps while this waited its turn with a connection.
    if (error == asio::error::operation_aborted || !acceptor_.is_open()) return;
    if (!error) {
      ++hub_->counters().connections;
      const ConnectionSlot slot(nullptr, [hub = hub_](void*) { --hub->counters().connections; });
      BoostError ignored;
      socket.set_option(tcp::no_delay(true), ignored);
      if (hub_->counters().connections.load() <= hub_->options().max_clients) {
        serve(TcpStream(std::move(socket)), slot);
      } else {
        // A short answer that fits the socket's buffer: no session is spent on it. Who waits for TLS gets none: what is
        // sent in the clear would pass for a server without TLS.
        static constexpr std::string_view kFull =
            "HTTP/1.1 503 Service Unavailable\r\nRetry-After: 5\r\nContent-Length: 0\r\nConnection: close\r\n\r\n";
        ++hub_->counters().connections_refused;
        socket.non_blocking(true, ignored);
        if (!tls_) socket.send(asio::buffer(kFull), 0, ignored);
      }
      return accept();
    }
    // Out of file descriptors, usually: trying again at once would spin.
    log::warn("accept: {}", error.message());
    retry_timer_.expires_after(std::chrono::milliseconds(100));
    retry_timer_.async_wait([this](BoostError aborted) {
      if (!aborted) accept();
    });
  });
}

void Server::State::watchSignals() {
  signals_.async_wait([this](BoostError error, int number) {
    if (error) return;
    const bool terminal_closed = on_terminal_ && !tls_;
    if (number == SIGHUP && !terminal_closed) {
      readAgain();
      return watchSignals();
    }
    if (std::exchange(signalled_, true)) {
      in_hurry_ = true;
      return context_.stop();
    }
    log::info("signal {}: draining", number);
    drain();
    watchSignals();
  });
}

/// Also where there is nothing to read: a service that is told to reload must not end. (Who runs the server by hand and
/// closes the terminal means just that.)
void Server::State::readAgain() {
  if (!tls_) return log::info("SIGHUP: there is no certificate to read again");
  const auto loaded = loadCertificate();
  loaded ? log::info("certificate read again") : log::error("the old certificate stays: {}", loaded.error().text());
}

void Server::State::drain() {
  asio::post(strand_, [this] {
    if (hub_->draining()) return;
    BoostError ignored;
    acceptor_.close(ignored);
    retry_timer_.cancel();
    beat_timer_.cancel();
    if (drain_hook_) drain_hook_();
    drain_until_ = Clock::now() + hub_->options().drain_grace;
    hub_->drain();
    waitForLast();
  });
}

/// Every thread of ours takes its turn at what is due, so that this comes late only where all of them hang.
void Server::State::beat() {
  last_beat_ = Clock::now().time_since_epoch().count();
  beat_timer_.expires_after(std::chrono::seconds(1));
  beat_timer_.async_wait([this](BoostError error) {
    if (!error) beat();
  });
}

void Server::State::waitForLast() {
  if (hub_->counters().connections.load() == 0 || Clock::now() >= drain_until_) return context_.stop();
  drain_timer_.expires_after(std::chrono::milliseconds(20));
  drain_timer_.async_wait([this](BoostError error) {
    if (!error) waitForLast();
  });
}

/// Until the end. Memory that runs out in the middle of an upload or an answer takes that connection with it, which
/// goes with its handler, and no other.
void Server::State::serveEvents() {
  while (!context_.stopped()) {
    try {
      context_.run();
    } catch (const std::bad_alloc&) {
      log::error("out of memory: a connection was dropped");
    }
  }
}

void Server::State::run() {
  hub_->start();
  asio::post(strand_, [this] {
    if (!acceptor_.is_open()) return;
    accept();
    beat();
  });
  std::vector<std::thread> helpers;
  for (int i = 1; i < hub_->options().threads; ++i) {
    helpers.emplace_back([this] { serveEvents(); });
    (void)pthread_setname_np(helpers.back().native_handle(), "net");  // for top -H, and what the benchmarks count
  }
  serveEvents();
  for (auto& helper : helpers) helper.join();
}

Server::Server(std::unique_ptr<State> state) : state_(std::move(state)) {}
Server::~Server() = default;

Result<std::unique_ptr<Server>> Server::open(const ServerOptions& options, engine::Engine& engine) {
  auto state = std::make_unique<State>(options, engine);
  if (auto opened = state->open(); !opened) return tl::unexpected(std::move(opened.error()));
  return std::unique_ptr<Server>(new Server(std::move(state)));
}

std::uint16_t Server::port() const { return state_->port_; }

std::string Server::url() const {
  const auto& address = state_->hub_->options().address;
  const auto* scheme = state_->hub_->options().tls_certificate.empty() ? "http" : "https";
  const bool six = address.find(':') != std::string::npos;
  return six ? fmt::format("{}://[{}]:{}", scheme, address, state_->port_)
             : fmt::format("{}://{}:{}", scheme, address, state_->port_);
}

void Server::drainOnSignals() {
  state_->signals_.add(SIGINT);
  state_->signals_.add(SIGTERM);
  state_->signals_.add(SIGHUP);
  state_->on_terminal_ = isatty(STDIN_FILENO) == 1;
  state_->watchSignals();
}

void Server::onDrain(std::function<void()> hook) { state_->drain_hook_ = std::move(hook); }

double Server::silentSeconds() const {
  const Clock::duration since(Clock::now().time_since_epoch().count() - state_->last_beat_);
  return std::chrono::duration<double>(since).count();
}

std::string Server::statusLine() const {
  const auto status = state_->hub_->engine().status();
  return fmt::format("{}, revision {}, error {:.2g} %, {} viewers", stateName(status.state), status.revision,
                     100.0 * status.error.total, state_->hub_->viewerCount());
}

void Server::run() { state_->run(); }
bool Server::inHurry() const { return state_->in_hurry_; }
void Server::drain() { state_->drain(); }

}  // namespace radiosity::net
