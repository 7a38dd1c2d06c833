// The messages of radiosity.v1 as plain values; README.md says what each means. A call's type names its method and the
// type of its reply, so a client can write call(StatusCall{}) and get a StatusReply.
// Units: lengths in metres, times in milliseconds where the name says so and seconds otherwise, errors as fractions
// (0.02 = 2 %), luminous flux in lumens.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "common/method.h"
#include "protocol/limits.h"
#include "protocol/planes.h"
#include "protocol/sky.h"

namespace radiosity::protocol {

// ---- names shared by messages and tiles (the numbers are those of the tile header) ----

enum class PixelFormat : std::uint8_t { kRgba16f = 0, kRgb9e5 = 1, kRgba32f = 2, kR32ui = 3 };
enum class Codec : std::uint8_t { kNone = 0, kDeflate = 1 };
enum class Quantity : std::uint8_t {
  kIrradiance = 0,
  kRadiosity = 1,
  kError = 2,
  kPatchId = 3,
  kMipLevel = 4,
  kUnshot = 5,
  kNormal = 6
};

[[nodiscard]] std::string_view name(PixelFormat format);  ///< "rgba16f", ...
[[nodiscard]] std::string_view name(Codec codec);         ///< "none", "deflate"
[[nodiscard]] std::string_view name(Quantity quantity);   ///< "irradiance", ...
[[nodiscard]] std::optional<PixelFormat> pixelFormatFrom(std::string_view name);
[[nodiscard]] std::optional<Codec> codecFrom(std::string_view name);
[[nodiscard]] std::optional<Quantity> quantityFrom(std::string_view name);
/// Whether texels are whole numbers, which travel as r32ui whatever format was chosen.
[[nodiscard]] constexpr bool holdsIds(Quantity quantity) {
  return quantity == Quantity::kPatchId || quantity == Quantity::kMipLevel;
}

// ---- parts ----

struct ErrorParts {
  double total = 1.0;   ///< at the surface, where people look
  double texels = 1.0;  ///< of texels alone; the next three are its parts
  double residual = 1.0, sampling = 0.0, variation = 0.0;
  double discretization = 0.0;
  /// What 95 % of places are off by less than; nothing: it is not measured yet, and `total` is an estimate.
  std::optional<double> p95 = std::nullopt;
  bool measuring = false;  ///< it is on its way
};

struct EnergyParts {
  double emitted = 0.0, absorbed = 0.0;
  double specular = 0.0;  ///< of mirrors, metal and glass; older servers do not tell it
  double escaped = 0.0, backface = 0.0, unshot = 0.0;
  double imbalance = 0.0;  ///< may be negative
};

struct Settings {
  double target_error = 0.02;
  std::optional<std::uint64_t> time_limit_ms;  ///< none: no limit (JSON null)
  std::uint64_t texels = kTexels;              ///< used when texel_size_m is 0; where they are chosen, the most
  double texel_size_m = 0.0;
  std::uint64_t seed = 1;
  std::optional<Sky> sky;  ///< none: JSON null
  bool double_sided = false;
  bool adaptive = false;
  Method method = Method::kGather;

  [[nodiscard]] bool choosesTexels() const { return radiosity::choosesTexels(adaptive, texel_size_m, method); }
};

struct PageInfo {
  std::uint32_t width = 0, height = 0, mips = 0;
};

/// "empty", "loading", "solving", "paused", "converged", "timeLimit", "limited", "failed" in `state`.
struct Progress {
  std::uint64_t revision = 0;
  std::string state = "empty";
  std::uint64_t tile_version = 0;
  std::uint64_t shots = 0;
  double shots_per_second = 0.0;
  double seconds = 0.0;
  std::optional<double> seconds_left;
  ErrorParts error;
  EnergyParts energy;
  std::uint64_t patches = 0, nodes = 0, surfaces = 0, polygons = 0;
  std::string failure;             ///< why, when state is "failed"
  std::string unlit;               ///< why no light arrives anywhere; empty: some does
  std::optional<double> fraction;  ///< how much of the load is done, in [0, 1]; while state is "loading"
};

/// Where somebody looks from: eye and the point looked at, metres, in the scene's space.
struct CameraPose {
  std::array<double, 3> position{}, target{};
  bool operator==(const CameraPose&) const = default;
};
struct SharedCamera {
  std::uint64_t viewer = 0;  ///< as in that viewer's own CameraReply
  std::string name;          ///< `client` of its hello
  CameraPose pose;
};

// ---- replies ----

struct HelloReply {
  std::string epoch;
  std::uint64_t revision = 0;
  PixelFormat tile_format = PixelFormat::kRgba16f;
  Codec codec = Codec::kNone;
  std::int64_t credit_bytes = kDefaultCreditBytes;
  bool resumed = false;  ///< what the client holds is still good; missed patches and newer tiles follow
};
struct SceneGetReply {
  std::uint64_t revision = 0;
  std::string gltf;  ///< JSON text of the document (a JSON value on the wire); empty when `url` is given
  std::string url;
};
struct SceneLoadReply {
  std::uint64_t revision = 0;
  std::vector<std::string> warnings;
};
struct ScenePatchReply {
  std::uint64_t revision = 0;
  std::uint64_t affected_surfaces = 0, affected_shots = 0;
};
/// Of undo and redo.
struct SceneStepReply {
  std::uint64_t revision = 0;
  std::uint64_t affected_surfaces = 0, affected_shots = 0;
  std::uint64_t edit = 0;  ///< the revision that the edit had made when it was new
};
/// How a revision came about: "load", "patch", "undo" or "redo" in `kind`.
struct PastRevision {
  std::uint64_t revision = 0;
  std::string kind;
  std::string by, summary;
  double time_s = 0.0;                ///< since 1970-01-01 UTC
  std::optional<std::uint64_t> edit;  ///< undo, redo: as in SceneStepReply
  bool undone = false;                ///< patch: taken back at present
};
struct SceneHistoryReply {
  std::uint64_t revision = 0;
  std::uint64_t undoable = 0, redoable = 0;
  std::vector<PastRevision> revisions;  ///< oldest first
};
/// Errors as in ErrorParts, at so many seconds of solve time.
struct ErrorSample {
  double seconds = 0.0;
  double total = 1.0, texels = 1.0, residual = 1.0, sampling = 0.0, variation = 0.0;
};
struct SolveHistoryReply {
  std::uint64_t revision = 0;
  std::vector<ErrorSample> samples;  ///< of the present solve, oldest first; at most kMaxErrorSamples
};
struct StateReply {
  std::string state;
};
struct StatusReply {
  Progress progress;
  Settings settings;
  std::vector<std::string> warnings;  ///< the first kMaxStatusWarnings
  std::uint64_t warning_count = 0;
  std::map<std::string, double> counters;
  std::string gl_renderer;
  std::optional<bool> reached;  ///< solve.wait only: the asked error was reached
};
struct SubscribeReply {
  std::vector<std::uint32_t> lightmaps;  ///< empty: all
  std::uint32_t min_mip = 0, max_mip = kMaxMip;
  double max_hz = 0.0;
  Quantity quantity = Quantity::kIrradiance;
};
struct CreditReply {
  std::int64_t credit_bytes = 0;
};
struct SnapshotReply {
  std::string url;
  std::optional<double> exposure;  ///< 1/nit, as given or as measured; none: false colours
};
struct TexelReply {
  std::uint64_t revision = 0, tile_version = 0;
  std::array<double, 3> irradiance{}, error{};  ///< lux, as the quantities of these names
};
struct ViewersReply {
  std::uint64_t count = 0;
};
struct CameraReply {
  std::optional<std::uint64_t> viewer;  ///< the caller's number in `cameras`; none: its camera is not shared
};

// ---- calls ----

struct Resume {
  std::string epoch;
  std::uint64_t revision = 0, tile_version = 0;
  Quantity quantity = Quantity::kIrradiance;  ///< of the tiles that the client holds
};
struct HelloCall {
  static constexpr std::string_view kMethod = "hello";
  using Reply = HelloReply;
  std::string client;
  std::string token;                           ///< empty: none
  std::vector<PixelFormat> tile_formats = {};  ///< in order of preference; empty: rgba16f
  std::vector<Codec> codecs = {};              ///< in order of preference; empty: none
  std::int64_t credit_bytes = kDefaultCreditBytes;
  std::optional<Resume> resume = {};
};
struct SceneGetCall {
  static constexpr std::string_view kMethod = "scene.get";
  using Reply = SceneGetReply;
};
struct SceneLoadCall {
  static constexpr std::string_view kMethod = "scene.load";
  using Reply = SceneLoadReply;
  std::string url;  ///< "/uploads/<id>", or "file:room.glb" below the server's --scene-root
};
struct ScenePatchCall {
  static constexpr std::string_view kMethod = "scene.patch";
  using Reply = ScenePatchReply;
  std::string patch;  ///< JSON text of the RFC 6902 array (a JSON value on the wire)
  std::optional<std::uint64_t> base_revision = {};
  std::optional<std::uint64_t> same_scene_as = {};  ///< a revision since which no other scene may have been loaded
  std::string request_id = {};                      ///< empty: none
  bool dry_run = false;
};
struct SceneUndoCall {
  static constexpr std::string_view kMethod = "scene.undo";
  using Reply = SceneStepReply;
  std::optional<std::uint64_t> base_revision = {};
  std::string request_id = {};  ///< empty: none
};
struct SceneRedoCall {
  static constexpr std::string_view kMethod = "scene.redo";
  using Reply = SceneStepReply;
  std::optional<std::uint64_t> base_revision = {};
  std::string request_id = {};
};
struct SceneHistoryCall {
  static constexpr std::string_view kMethod = "scene.history";
  using Reply = SceneHistoryReply;
  std::uint64_t limit = kMaxHistory;  ///< the newest
};
struct SolveConfigureCall {
  static constexpr std::string_view kMethod = "solve.configure";
  using Reply = Settings;
  std::optional<double> target_error = {};
  std::optional<std::uint64_t> time_limit_ms = {};
  bool no_time_limit = false;  ///< "timeLimitMs": null
  std::optional<std::uint64_t> texels = {};
  std::optional<double> texel_size_m = {};
  std::optional<std::uint64_t> seed = {};
  std::optional<Sky> sky = {};
  bool no_sky = false;  ///< "sky": null
  std::optional<bool> double_sided = {};
  std::optional<bool> adaptive = {};
  std::optional<Method> method = {};
};
struct SolvePauseCall {
  static constexpr std::string_view kMethod = "solve.pause";
  using Reply = StateReply;
};
struct SolveResumeCall {
  static constexpr std::string_view kMethod = "solve.resume";
  using Reply = StateReply;
};
struct SolveRestartCall {
  static constexpr std::string_view kMethod = "solve.restart";
  using Reply = StateReply;
};
struct SolveWaitCall {
  static constexpr std::string_view kMethod = "solve.wait";
  using Reply = StatusReply;
  std::optional<double> error = {};            ///< none: the target error in force
  std::optional<std::uint64_t> revision = {};  ///< at least this one; none: the current one
  std::optional<std::uint64_t> timeout_ms = {};
};
struct SolveHistoryCall {
  static constexpr std::string_view kMethod = "solve.history";
  using Reply = SolveHistoryReply;
};
/// Illuminance on the scene's measuring planes.
struct SolveMeasureCall {
  static constexpr std::string_view kMethod = "solve.measure";
  using Reply = Planes;
  std::string plane = {};        ///< name or index of its node; empty: all
  bool daylight_factor = false;  ///< also under a CIE overcast sky, all lamps off
};
struct StatusCall {
  static constexpr std::string_view kMethod = "status";
  using Reply = StatusReply;
};
struct SubscribeCall {
  static constexpr std::string_view kMethod = "subscribe";
  using Reply = SubscribeReply;
  std::vector<std::uint32_t> lightmaps = {};  ///< empty: all
  std::uint32_t min_mip = 0, max_mip = kMaxMip;
  double max_hz = 0.0;  ///< 0: as fast as published
  Quantity quantity = Quantity::kIrradiance;
};
struct CreditCall {
  static constexpr std::string_view kMethod = "credit";
  using Reply = CreditReply;
  std::int64_t bytes = 0;
};
struct SnapshotCall {
  static constexpr std::string_view kMethod = "snapshot";
  using Reply = SnapshotReply;
  std::string camera = {};
  int width = 960, height = 720;
  std::string quantity = "lit";
  std::optional<double> exposure = {};  ///< 1/nit; none: measured
};
/// What one texel of the lightmaps has.
struct TexelCall {
  static constexpr std::string_view kMethod = "texel";
  using Reply = TexelReply;
  std::uint32_t page = 0, x = 0, y = 0;  ///< of mip 0; row 0 is v = 0
};
struct ViewersCall {
  static constexpr std::string_view kMethod = "viewers";
  using Reply = ViewersReply;
};
/// Shares where the caller looks from, and makes it hear of the others; without a pose neither any longer.
struct CameraCall {
  static constexpr std::string_view kMethod = "camera";
  using Reply = CameraReply;
  std::optional<CameraPose> pose = {};
};

using Call = std::variant<HelloCall, SceneGetCall, SceneLoadCall, ScenePatchCall, SceneUndoCall, SceneRedoCall,
                          SceneHistoryCall, SolveConfigureCall, SolvePauseCall, SolveResumeCall, SolveRestartCall,
                          SolveWaitCall, SolveHistoryCall, SolveMeasureCall, StatusCall, SubscribeCall, CreditCall,
                          SnapshotCall, TexelCall, ViewersCall, CameraCall>;

// ---- notifications from the server ----

struct ServerInfo {
  static constexpr std::string_view kMethod = "serverInfo";
  std::string server;  ///< "radiosityd/0.1.0"
  std::string epoch;   ///< changes whenever revisions may start again
  std::uint64_t revision = 0;
  std::vector<std::string> capabilities;
  std::map<std::string, std::uint64_t> limits;
  std::uint64_t lightmaps = 0;  ///< number of pages now
  std::string gl_renderer;
  bool auth_required = false;
};
struct ProgressNote {
  static constexpr std::string_view kMethod = "progress";
  Progress progress;
};
struct ScenePatched {
  static constexpr std::string_view kMethod = "scene.patched";
  std::uint64_t revision = 0;
  std::string patch;  ///< JSON text of the array
  std::string by;
};
struct SceneLoaded {
  static constexpr std::string_view kMethod = "scene.loaded";
  std::uint64_t revision = 0;
};
struct LightmapsNote {
  static constexpr std::string_view kMethod = "lightmaps";
  std::uint64_t layout = 0, revision = 0;
  Quantity quantity = Quantity::kIrradiance;  ///< of the tiles that follow
  std::vector<PageInfo> pages;
  std::string uvs;  ///< URL of the GLB that holds the lightmap UVs of this layout
};
struct Bookmark {
  static constexpr std::string_view kMethod = "bookmark";
  std::uint64_t revision = 0, tile_version = 0;
  Quantity quantity = Quantity::kIrradiance;
};
struct ViewersNote {
  static constexpr std::string_view kMethod = "viewers";
  std::uint64_t count = 0;
};
struct CamerasNote {
  static constexpr std::string_view kMethod = "cameras";
  std::vector<SharedCamera> cameras;  ///< all that are shared, the receiver's among them
};
struct Draining {
  static constexpr std::string_view kMethod = "draining";
  std::uint64_t grace_ms = 0;
};

/// Something happened to the server that those who watch may wonder about; nothing need be done.
struct ServerNote {
  static constexpr std::string_view kMethod = "notice";
  std::string kind;  ///< "rendererReplaced", "solveRestarted"; others may come
  std::string text;  ///< for people
};

/// Somebody has changed what the solve aims at.
struct SolveConfigured {
  static constexpr std::string_view kMethod = "solve.configured";
  Settings settings;  ///< all that are in force
};

using Notification = std::variant<ServerInfo, ProgressNote, ScenePatched, SceneLoaded, LightmapsNote, Bookmark,
                                  ViewersNote, CamerasNote, Draining, ServerNote, SolveConfigured>;

}  // namespace radiosity::protocol
