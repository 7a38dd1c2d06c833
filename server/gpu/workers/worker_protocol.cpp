#include "server/gpu/workers/worker_protocol.h"

#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "common/check.h"

namespace radiosity::gpu {
namespace {

struct Header {
  MessageKind kind;
  std::uint32_t bytes;
};

template <typename T>
void packVector(std::vector<std::byte>& to, const std::vector<T>& values) {
  appendValue(to, static_cast<std::uint64_t>(values.size()));
  appendSpan(to, std::span<const T>(values));
}

template <typename T>
void unpackVector(BodyReader& from, std::vector<T>& values) {
  values = from.values<T>(from.value<std::uint64_t>());
}

/// Calls visit(vector) for each part of a scene that travels.
template <typename Scene, typename Visit>
void visitScene(Scene& scene, Visit visit) {
  visit(scene.vertices);
  visit(scene.indices);
  visit(scene.triangles);
  visit(scene.triangle_surface);
  visit(scene.surfaces);
  visit(scene.solids.solid_of);
  visit(scene.solids.bounds);
  visit(scene.leaves);
  scene::LeafSpots::visitParts(scene.spots, visit);
  visit(scene.node_area);
  visit(scene.opacity);
}

/// At the beginning of a region of accumulators.
struct RegionHead {
  FluxTotals totals;
  std::atomic<std::uint64_t> put_off;
};
static_assert(std::atomic<std::uint64_t>::is_always_lock_free, "shared between processes");

using Done = tl::expected<void, Lapse>;

/// poll()'s timeout, rounded up so that the deadline has passed when it returns; -1: none.
int timeoutMs(const Patience& patience) {
  if (!patience.deadline) return -1;
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(*patience.deadline - std::chrono::steady_clock::now());
  constexpr std::chrono::milliseconds kMost = std::chrono::hours(24);  // fits an int
  return static_cast<int>(std::clamp(left, std::chrono::milliseconds(0), kMost).count());
}

/// Until the socket can be written (POLLOUT) or read (POLLIN), or is closed, which the call after this finds out.
Done await(int socket, short events, const Patience& patience) {
  std::array<pollfd, 2> polls{pollfd{socket, events, 0}, pollfd{patience.wake_fd, POLLIN, 0}};
  while (true) {
    const int ready = poll(polls.data(), polls.size(), timeoutMs(patience));
    if (ready < 0 && errno == EINTR) continue;
    if (ready < 0) return tl::unexpected(Lapse::kGone);
    if (polls[1].revents != 0) return tl::unexpected(Lapse::kWoken);
    if (ready == 0) return tl::unexpected(Lapse::kLate);
    return {};
  }
}

/// Whether the call just made would have had to wait, or was interrupted: then it is to be made again.
bool again() { return errno == EINTR || errno == EAGAIN || errno == EWOULDBLOCK; }

Done receiveBytes(int socket, void* to, std::size_t bytes, const Patience& patience) {
  auto* at = static_cast<std::byte*>(to);
  while (bytes > 0) {
    if (auto ready = await(socket, POLLIN, patience); !ready) return ready;
    const auto got = recv(socket, at, bytes, MSG_DONTWAIT);
    if (got < 0 && again()) continue;
    if (got <= 0) return tl::unexpected(Lapse::kGone);
    at += got;
    bytes -= static_cast<std::size_t>(got);
  }
  return {};
}

/// The header, and the descriptors that came with it.
Done receiveHeader(int socket, Header& header, std::array<FileDescriptor, 2>& fds, const Patience& patience) {
  alignas(cmsghdr) std::array<char, CMSG_SPACE(2 * sizeof(int))> control{};
  iovec part{&header, sizeof(header)};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  ssize_t got = 0;
  do {
    if (auto ready = await(socket, POLLIN, patience); !ready) return ready;
    got = recvmsg(socket, &message, MSG_CMSG_CLOEXEC | MSG_DONTWAIT);
  } while (got < 0 && again());
  if (got <= 0) return tl::unexpected(Lapse::kGone);
  for (auto* item = CMSG_FIRSTHDR(&message); item != nullptr; item = CMSG_NXTHDR(&message, item)) {
    if (item->cmsg_level != SOL_SOCKET || item->cmsg_type != SCM_RIGHTS) continue;
    const auto count = (item->cmsg_len - CMSG_LEN(0)) / sizeof(int);
    for (std::size_t i = 0; i < count && i < fds.size(); ++i) {
      int fd = -1;
      std::memcpy(&fd, CMSG_DATA(item) + i * sizeof(int), sizeof(int));
      fds[i] = FileDescriptor(fd);
    }
  }
  const auto have = static_cast<std::size_t>(got);
  return receiveBytes(socket, reinterpret_cast<std::byte*>(&header) + have, sizeof(header) - have, patience);
}

}  // namespace

void append(std::vector<std::byte>& to, const void* data, std::size_t bytes) {
  const auto* from = static_cast<const std::byte*>(data);
  to.insert(to.end(), from, from + bytes);
}

void BodyReader::take(void* to, std::size_t bytes) {
  if (bytes > rest_.size()) {
    good_ = false;
    return;
  }
  if (bytes > 0) std::memcpy(to, rest_.data(), bytes);
  rest_ = rest_.subspan(bytes);
}

tl::expected<void, Lapse> sendMessage(int socket, MessageKind kind, std::span<const std::byte> body,
                                      std::span<const int> fds, const Patience& patience) {
  RAD_CHECK_LE(body.size(), kMaxBody);
  RAD_CHECK_LE(fds.size(), std::size_t{2});
  Header header{kind, static_cast<std::uint32_t>(body.size())};
  std::array<iovec, 2> parts{iovec{&header, sizeof(header)}, iovec{const_cast<std::byte*>(body.data()), body.size()}};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(2 * sizeof(int))> control{};
  msghdr message{};
  message.msg_iov = parts.data();
  message.msg_iovlen = parts.size();
  if (!fds.empty()) {
    message.msg_control = control.data();
    message.msg_controllen = CMSG_SPACE(fds.size_bytes());
    auto* item = CMSG_FIRSTHDR(&message);
    item->cmsg_level = SOL_SOCKET;
    item->cmsg_type = SCM_RIGHTS;
    item->cmsg_len = CMSG_LEN(fds.size_bytes());
    std::memcpy(CMSG_DATA(item), fds.data(), fds.size_bytes());
  }
  while (parts[0].iov_len + parts[1].iov_len > 0) {
    if (auto ready = await(socket, POLLOUT, patience); !ready) return ready;
    const auto sent = sendmsg(socket, &message, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (sent < 0 && again()) continue;
    if (sent < 0) return tl::unexpected(Lapse::kGone);
    auto left = static_cast<std::size_t>(sent);
    for (auto& part : parts) {
      const auto from_part = std::min(left, part.iov_len);
      part.iov_base = static_cast<std::byte*>(part.iov_base) + from_part;
      part.iov_len -= from_part;
      left -= from_part;
    }
    message.msg_control = nullptr;  // descriptors go once
    message.msg_controllen = 0;
  }
  return {};
}

tl::expected<Message, Lapse> receiveMessage(int socket, const Patience& patience) {
  Header header{};
  Message message;
  if (auto come = receiveHeader(socket, header, message.fds, patience); !come) return tl::unexpected(come.error());
  if (header.bytes > kMaxBody) return tl::unexpected(Lapse::kNonsense);
  message.kind = header.kind;
  message.body.resize(header.bytes);
  if (auto come = receiveBytes(socket, message.body.data(), message.body.size(), patience); !come) {
    return tl::unexpected(come.error());
  }
  return message;
}

Result<SharedMemory> packScene(const scene::PatchScene& patches) {
  // Straight to where it is needed: of many texels a copy is as large as all else that is made of them.
  std::size_t bytes = 0;
  visitScene(patches, [&](const auto& values) { bytes += sizeof(std::uint64_t) + std::span(values).size_bytes(); });
  auto memory = SharedMemory::create("radiosity scene", bytes);
  if (!memory) return memory;
  auto* to = memory->bytes().data();
  const auto put = [&to](const void* from, std::size_t count) {
    if (count > 0) std::memcpy(to, from, count);
    to += count;
  };
  visitScene(patches, [&](const auto& values) {
    const std::uint64_t count = values.size();
    put(&count, sizeof(count));
    put(values.data(), std::span(values).size_bytes());
  });
  return memory;
}

Result<std::shared_ptr<const scene::PatchScene>> unpackScene(std::span<const std::byte> packed) {
  auto scene = std::make_shared<scene::PatchScene>();
  BodyReader from(packed);
  visitScene(*scene, [&](auto& values) { unpackVector(from, values); });
  if (!from.good()) return fail(ErrorCode::kInternal, "a packed scene is cut short");
  return scene;
}

void packLinks(std::vector<std::byte>& to, const solver::LinkSample& links) {
  appendValue(to, links.escaped);
  appendValue(to, links.absorbed);
  appendValue(to, links.delivered);
  appendValue(to, links.due);
  appendValue(to, links.open_looks);
  packVector(to, links.runs);
  packVector(to, links.irradiance);
}

bool unpackLinks(BodyReader& from, std::size_t nodes, solver::LinkSample& links) {
  links.escaped = from.value<double>();
  links.absorbed = from.value<double>();
  links.delivered = from.value<double>();
  links.due = from.value<double>();
  links.open_looks = from.value<solver::Looks>();
  unpackVector(from, links.runs);
  unpackVector(from, links.irradiance);
  std::size_t values = 0;
  for (const auto& run : links.runs) {
    if (run.first_node > nodes || run.count > nodes - run.first_node) return false;
    values += run.count;
  }
  return from.good() && values == links.irradiance.size();
}

std::size_t fluxRegionBytes(std::size_t nodes) {
  return sizeof(RegionHead) + 2 * (nodes * sizeof(solver::Flux3) + markCount(nodes));
}

FluxSink fluxRegionSink(std::span<std::byte> region, std::size_t nodes) {
  RAD_CHECK_LE(fluxRegionBytes(nodes), region.size());
  auto* totals = &reinterpret_cast<RegionHead*>(region.data())->totals;
  auto* node = reinterpret_cast<solver::Flux3*>(region.data() + sizeof(RegionHead));
  auto* mark = reinterpret_cast<std::uint8_t*>(node + 2 * nodes);
  const auto marks = markCount(nodes);
  return {{std::span(node, nodes), std::span(node + nodes, nodes)},
          {std::span(mark, marks), std::span(mark + marks, marks)},
          totals};
}

std::atomic<std::uint64_t>& putOffMark(std::span<std::byte> region) {
  RAD_CHECK_LE(sizeof(RegionHead), region.size());
  return reinterpret_cast<RegionHead*>(region.data())->put_off;
}

}  // namespace radiosity::gpu
