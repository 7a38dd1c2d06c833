// Every bound of the protocol in one place; README.md lists the same figures. Both ends may use this header.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace radiosity::protocol {

inline constexpr std::string_view kSubprotocol = "radiosity.v1";  ///< Sec-WebSocket-Protocol
inline constexpr std::string_view kWebSocketPath = "/ws";

// Messages.
inline constexpr std::size_t kMaxMessageBytes = std::size_t{1} << 20;  ///< one text frame, either direction
inline constexpr std::size_t kMaxJsonDepth = 64;                       ///< arrays and objects inside each other
inline constexpr std::size_t kMaxBatch = 64;                           ///< calls in a JSON-RPC batch
inline constexpr std::size_t kMaxRequestIdBytes = 128;                 ///< JSON-RPC `id`, as JSON text
inline constexpr std::size_t kMaxPatchOperations = 5000;
inline constexpr std::size_t kMaxHistory = 256;       ///< revisions that scene.history tells of
inline constexpr std::size_t kMaxErrorSamples = 300;  ///< that solve.history tells of
inline constexpr std::size_t kMaxTextBytes = 256;     ///< names, camera, requestId, client
inline constexpr std::size_t kMaxTokenBytes = 4096;
inline constexpr std::size_t kMaxListEntries = 4096;                       ///< e.g. subscribe.lightmaps
inline constexpr std::size_t kMaxInlineSceneBytes = std::size_t{1} << 19;  ///< a longer scene is given by URL
inline constexpr std::size_t kMaxStatusWarnings = 200;
inline constexpr std::size_t kMaxCallsInFlight = 64;  ///< of one connection, waiting for their answer

// Cameras of other viewers.
inline constexpr std::size_t kMaxCameras = 64;            ///< shared at a time
inline constexpr double kMaxCoordinateM = 1e12;           ///< of eye and target
inline constexpr std::size_t kCameraCallsPerSecond = 20;  ///< of one connection, and as many at once
inline constexpr std::uint32_t kCamerasIntervalMs = 100;  ///< between two `cameras` to one connection

// Tiles.
inline constexpr std::uint32_t kTileSide = 64;  ///< texels; tiles at a page's right and bottom edge are smaller
inline constexpr std::size_t kTileHeaderBytes = 64;
inline constexpr std::size_t kMaxPixelBytes = 16;
inline constexpr std::size_t kMaxTileRawBytes = std::size_t{kTileSide} * kTileSide * kMaxPixelBytes;
/// The encoder falls back to codec `none` where deflate does not shrink, so a payload never exceeds the raw pixels.
inline constexpr std::size_t kMaxTileFrameBytes = kTileHeaderBytes + kMaxTileRawBytes;
inline constexpr std::uint32_t kMaxMip = 16;

// Flow control.
inline constexpr std::int64_t kDefaultCreditBytes = std::int64_t{1} << 20;
inline constexpr std::int64_t kMaxCreditBytes = std::int64_t{1} << 26;
inline constexpr std::size_t kControlLaneMessages = 256;
inline constexpr std::size_t kControlLaneBytes = std::size_t{1} << 20;
inline constexpr std::uint32_t kHelloTimeoutMs = 5'000;
inline constexpr std::uint32_t kWriteDeadlineMs = 10'000;
inline constexpr std::uint64_t kMaxTimeLimitMs = 1'000'000'000'000;  ///< 31 years
inline constexpr std::uint32_t kMaxWaitMs = 24U * 3600U * 1000U;     ///< longest solve.wait

// Server-wide defaults; flags of radiosityd change them.
inline constexpr std::size_t kMaxClients = 256;
inline constexpr std::size_t kMaxUploadBytes = std::size_t{1} << 30;
inline constexpr std::size_t kMaxTlsHandshakes = 64;  ///< under way at a time; each costs the server more than its peer
inline constexpr int kMaxSnapshotSide = 4096;         ///< pixels
inline constexpr double kMaxExposure = 1e30;          ///< of a snapshot, 1/nit

/// WebSocket close codes that this protocol uses.
enum class CloseCode : std::uint16_t {
  kNormal = 1000,
  kGoingAway = 1001,  ///< the server drains
  kBadData = 1003,    ///< a binary frame from a client
  kPolicy = 1008,     ///< no or wrong token, hello missing or late
  kTooBig = 1009,     ///< a message over kMaxMessageBytes
  kOverload = 1013,   ///< the control lane is full: the client does not read
  kTooSlow = 4408,    ///< a write did not finish within kWriteDeadlineMs
};

}  // namespace radiosity::protocol
