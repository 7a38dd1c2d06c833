#include "server/state/path_claim.h"

#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstddef>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>

#include "common/sha256.h"
#include "server/state/known_files.h"

namespace radiosity::state {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;

constexpr auto kPatience = 1s;

/// An address that begins with a NUL is no file: Linux keeps it by name (unix(7), "Abstract sockets").
struct Address {
  sockaddr_un socket{};
  socklen_t length = 0;

  explicit Address(const fs::path& folder) {
    std::error_code ignored;
    const auto whole = fs::weakly_canonical(fs::absolute(folder, ignored), ignored);
    // The folder above tells apart what has the same path in two containers.
    const auto above = identityOf(whole.parent_path());
    const auto place =
        above ? fmt::format("{}:{}/{}", above->device, above->inode, whole.filename().string()) : whole.string();
    const auto name = "radiosityd-state-" + sha256Hex(std::string_view(place));
    socket.sun_family = AF_UNIX;
    std::copy(name.begin(), name.end(), socket.sun_path + 1);
    length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
  }
  [[nodiscard]] const sockaddr* get() const { return reinterpret_cast<const sockaddr*>(&socket); }
};

int streamSocket() { return ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0); }

/// Who listens there; -1: it cannot be told.
pid_t ownerOf(const Address& address) {
  const int asking = streamSocket();
  ucred owner{};
  socklen_t size = sizeof owner;
  const bool told = asking >= 0 && connect(asking, address.get(), address.length) == 0 &&
                    getsockopt(asking, SOL_SOCKET, SO_PEERCRED, &owner, &size) == 0;
  if (asking >= 0) close(asking);
  return told ? owner.pid : -1;
}

}  // namespace

PathClaim PathClaim::take(const fs::path& folder) {
  const Address address(folder);
  PathClaim claim(streamSocket());
  const auto deadline = std::chrono::steady_clock::now() + kPatience;
  while (claim.descriptor_ >= 0 && bind(claim.descriptor_, address.get(), address.length) != 0) {
    if (errno != EADDRINUSE) break;
    if (std::chrono::steady_clock::now() > deadline) {
      claim.other_ = ownerOf(address);
      return claim;
    }
    std::this_thread::sleep_for(10ms);
  }
  // Nobody accepts: whoever asks who listens here has the answer once the connection waits in the queue.
  if (claim.descriptor_ >= 0) (void)listen(claim.descriptor_, SOMAXCONN);
  return claim;
}

PathClaim::PathClaim(PathClaim&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)), other_(other.other_) {}

PathClaim::~PathClaim() {
  if (descriptor_ >= 0) close(descriptor_);
}

}  // namespace radiosity::state
