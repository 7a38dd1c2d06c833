// Many viewers of one radiosityd in one thread: each a non-blocking socket that speaks as much WebSocket as the server
// does, subscribes, gives credit back, and notes when what came. For the loopback address. Used by one thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "protocol/tile_frame.h"

namespace radiosity::benchmark {

using Clock = std::chrono::steady_clock;

struct ViewerRecord {
  Clock::time_point started;
  std::optional<Clock::time_point> first_tile;
  std::map<std::uint64_t, Clock::time_point> bookmarks;  ///< by tile version: when everything up to it had come
  /// CRC-32C of the newest pixels of every tile, by page, mip, x and y.
  std::map<std::tuple<std::uint32_t, int, std::uint32_t, std::uint32_t>, std::uint32_t> crc;
  std::uint64_t tile_bytes = 0;
  std::string state;  ///< of the last progress notification
  bool ended = false, reads = true;
};

class Swarm {
 public:
  explicit Swarm(std::uint16_t port);
  ~Swarm();
  Swarm(const Swarm&) = delete;
  Swarm& operator=(const Swarm&) = delete;

  /// Connects so many more. `reads` false: after its handshake it never reads again. Throws std::runtime_error when
  /// the server cannot be reached or a frame is not sound.
  void add(int count, bool reads = true);
  void closeAll();

  /// Serves all until `done()`, which is asked after every round; false: the limit has passed.
  bool run(const std::function<bool()>& done, std::chrono::seconds limit);

  [[nodiscard]] std::vector<const ViewerRecord*> records() const;
  /// Whether every viewer that reads has a bookmark of at least this version.
  [[nodiscard]] bool allHave(std::uint64_t version) const;

 private:
  struct Viewer;
  void service(Viewer& viewer);
  static void take(Viewer& viewer);
  static void onFrame(Viewer& viewer, unsigned opcode, std::span<const std::uint8_t> payload);
  static void onText(Viewer& viewer, const std::string& text);
  static void onTile(Viewer& viewer, std::span<const std::uint8_t> frame);
  static void send(Viewer& viewer, const std::string& text);

  std::uint16_t port_;
  std::vector<std::unique_ptr<Viewer>> viewers_;
};

}  // namespace radiosity::benchmark
