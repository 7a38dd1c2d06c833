// The engine's face to the network: values in, values out. All methods are thread-safe. Listener calls come from the
// solve thread, callbacks from whichever thread of the engine has the answer; neither may block: a session posts them
// to its own strand.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <map>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "common/bytes.h"
#include "common/image.h"
#include "common/method.h"
#include "common/result.h"

namespace radiosity::engine {

/// kLimited: done what it could, above the target error (Status::failure says what was used up); it goes on after an
/// edit.
enum class SolveState { kEmpty, kLoading, kSolving, kPaused, kConverged, kTimeLimit, kLimited, kFailed };

/// Relative RMS errors of irradiance; estimates.
struct ErrorEstimate {
  /// What people see: how far bilinear lookups at random places of surfaces are off. Measured once light is solved for
  /// (Status::surface_error); until then `texels` and `discretization` together, or less where better light is shown
  /// meanwhile.
  double total = 1.0;
  /// Of texels alone, area-weighted: texels^2 = residual^2 + sampling^2 + variation^2.
  double texels = 1.0;
  double residual = 1.0, sampling = 0.0, variation = 0.0;
  double discretization = 0.0;  ///< between texels, by how they differ from their parents
};

/// What people see of it, measured by rays at random places of surfaces once light is solved for. Relative to the RMS
/// of irradiance.
struct SurfaceEstimate {
  double total = 0.0;      ///< RMS over places
  double deviation = 0.0;  ///< standard deviation of that
  double p95 = 0.0;        ///< 95 % of places are off by less, each relative to its own light
};

/// Luminous flux, lumens (luminance: the channels weighted by Rec. 709).
/// emitted = absorbed + specular + escaped + backface + unshot + imbalance.
struct EnergyBalance {
  double emitted = 0.0, absorbed = 0.0;
  double specular =
      0.0;  ///< what arrives at mirrors, metal and glass and is not reflected; `absorbed` is of the others
  double escaped = 0.0, backface = 0.0, unshot = 0.0;
  /// What unbiased sampling lost by chance (negative: gained); it falls with the sampling error.
  double imbalance = 0.0;
};

/// The error at some time of a solve.
struct ErrorSample {
  double seconds = 0.0;  ///< solve time
  ErrorEstimate error;
};
/// Samples that are kept of a solve, at most.
inline constexpr std::size_t kErrorSamples = 300;
struct SolveHistory {
  std::uint64_t revision = 0;        ///< of the scene that is being solved
  std::vector<ErrorSample> samples;  ///< of the present solve, oldest first
};

/// What a lightmap can hold.
enum class Quantity {
  kIrradiance,  ///< H, lux
  kRadiosity,   ///< B = E + rho H, lm/m^2
  kError,       ///< standard error of H, lux: what the stated sampling and residual error amount to at this texel
  kPatchId,     ///< whole numbers: the leaf patch's node; kNoId in gutters
  kMipLevel,    ///< whole numbers: level of the node that last shot for the texel; kNoId where none has
  kUnshot,      ///< radiosity still to be shot, lm/m^2, signed
  kNormal,      ///< geometric normal of the front, (n + 1) / 2
};
inline constexpr std::size_t kQuantityCount = 7;
inline constexpr std::uint32_t kNoId = 0xffffffffU;
/// Whether texels are whole numbers, which cannot be averaged.
[[nodiscard]] constexpr bool holdsIds(Quantity quantity) {
  return quantity == Quantity::kPatchId || quantity == Quantity::kMipLevel;
}

/// Radiance of everything outside the scene, nits: above the horizon (+Y), and below it.
struct SkySetting {
  glm::vec3 upper{0.0F}, lower{0.0F};
  bool operator==(const SkySetting&) const = default;
};

struct SolveSettings {
  double target_error = 0.02;          ///< relative; stops when the estimate reaches it
  std::optional<double> time_limit_s;  ///< solve time
  std::uint64_t texels = kTexels;      ///< leaf patches in all, about; used when texel_size_m is 0
  double texel_size_m = 0.0;
  /// `texels` are the most there may be: as few are made, finer where light wants it, as meet the target at the
  /// surface.
  bool adaptive = false;
  std::uint64_t seed = 1;
  std::optional<SkySetting> sky;  ///< for scenes that have none of their own
  bool double_sided = false;      ///< all materials are, whatever the scene says
  Method method = Method::kGather;
  std::uint64_t link_memory_bytes = std::uint64_t{1} << 30;  ///< that remembered links never exceed (server option)
  /// Texels hold the mean light of what they cover, and not what bilinear lookups come closest with (server option).
  bool texels_are_means = false;

  bool operator==(const SolveSettings&) const = default;
  [[nodiscard]] bool choosesTexels() const { return radiosity::choosesTexels(adaptive, texel_size_m, method); }
  [[nodiscard]] std::uint64_t usualTexels() const { return radiosity::usualTexels(choosesTexels()); }
};

/// Warnings that a Status holds at most: it is made ten times a second, and scenes have as many as they have materials.
inline constexpr std::size_t kStatusWarnings = 200;

struct Status {
  SolveState state = SolveState::kEmpty;
  std::uint64_t revision = 0;      ///< of the scene; raised by load and patch
  std::uint64_t tile_version = 0;  ///< raised whenever lightmaps are published
  std::uint64_t layout_since = 0;  ///< first tile version with the present pages, sizes and UVs
  std::uint64_t shots = 0;
  double shots_per_second = 0.0;
  double seconds = 0.0;                ///< solve time, without start-up and loading
  std::optional<double> seconds_left;  ///< estimate to the target error
  ErrorEstimate error;
  std::optional<SurfaceEstimate> surface_error;  ///< nothing: it is not measured, yet
  bool probes_surface = false;                   ///< it is being measured
  EnergyBalance energy;
  std::uint64_t patches = 0;  ///< leaf patches with area
  std::uint64_t nodes = 0, surfaces = 0, polygons = 0, pages = 0;
  std::map<std::string, double> counters;  ///< skips, culls, times: whatever the solver counts
  std::string gl_renderer;
  std::optional<double> load_fraction;  ///< how much of the load is done, in [0, 1]; while kLoading
  std::vector<std::string> warnings;    ///< the first kStatusWarnings
  std::uint64_t warning_count = 0;      ///< of all
  std::string failure;                  ///< why, when kFailed or kLimited
  std::string unlit;  ///< why no light arrives anywhere, so that `error` means nothing; empty: some does
  /// Nothing can be drawn at present (a driver is gone, all renderers died); the solve starts over when it can.
  bool renderer_lost = false;
  std::uint64_t renderers_replaced = 0, solve_restarts = 0;  ///< since the start of the program
  /// Of so many renderers so many died while idle and are being replaced; why the last one did.
  std::uint64_t renderers = 0, renderers_missing = 0;
  std::string renderer_trouble;
  std::string state_trouble;  ///< why no edit can be kept: the state's folder is gone; empty: it is where it was
  SolveSettings settings;
};

struct IdImage {
  int width = 0, height = 0;
  std::vector<std::uint32_t> ids;  ///< width * height, row-major
};

/// One published page: mip 0 is the page itself. Immutable.
struct PageSnapshot {
  std::vector<Image> mips;       ///< of values; empty where the quantity is whole numbers
  std::vector<IdImage> id_mips;  ///< the other way round; each texel is the first of the finer four that is no kNoId
  /// tile_version[mip][ty * tiles_x + tx]: Status::tile_version at which the tile's 64 x 64 texels last changed; 0:
  /// never.
  std::vector<std::vector<std::uint64_t>> tile_version;
  /// mean relative change of each tile in that version, for "largest change first"
  std::vector<std::vector<float>> tile_change;

  [[nodiscard]] std::size_t mipCount() const { return mips.empty() ? id_mips.size() : mips.size(); }
  [[nodiscard]] glm::ivec2 size(std::size_t mip) const {
    return mips.empty() ? glm::ivec2(id_mips[mip].width, id_mips[mip].height)
                        : glm::ivec2(mips[mip].width, mips[mip].height);
  }
};

inline constexpr std::uint32_t kTileSize = 64;

/// Everything a viewer can see at one moment. Immutable, shared.
struct Lightmaps {
  Quantity quantity = Quantity::kIrradiance;
  std::uint64_t layout = 0;  ///< raised when pages, sizes or UVs change (viewers must fetch /scene.glb again)
  std::uint64_t revision = 0;
  std::uint64_t tile_version = 0;
  std::uint32_t shots = 0;
  float error = 1.0F;
  bool final = false;  ///< the solve has stopped at its target
  std::vector<std::shared_ptr<const PageSnapshot>> pages;
};

/// Who asks for what takes long: a load, a picture, a file. Implicitly made of a name.
struct Client {
  Client() = default;
  Client(std::string by) : name(std::move(by)) {}
  Client(const char* by) : name(by) {}
  Client(std::string by, std::uint64_t number, std::stop_token token)
      : name(std::move(by)), session(number), gone(std::move(token)) {}

  std::string name;           ///< for the history; empty where nobody asked
  std::uint64_t session = 0;  ///< its connection, among which pictures and files are made in turn; 0: none
  std::stop_token gone = {};  ///< stopped when it no longer waits: what is not answered by then is called off
};

struct LoadOutcome {
  std::uint64_t revision = 0;
  std::vector<std::string> warnings;
};

/// What makes the retry of an edit harmless, also after a restart.
struct Receipt {
  std::string request_id;         ///< empty: the edit came without
  std::uint64_t fingerprint = 0;  ///< of the whole request
};

struct PatchRequest {
  std::string patch;  ///< JSON text of the RFC 6902 array, depth and size already bounded
  std::optional<std::uint64_t> base_revision = {};
  std::optional<std::uint64_t> same_scene_as = {};  ///< a revision since which no other scene may have been loaded
  bool dry_run = false;
  std::string by = {};  ///< who, for scene.patched
  /// The bytes of an upload that the patch refers to; null: there is no such upload. Called on the solve thread.
  std::function<SharedBytes(const std::string& uri)> find_upload = {};
  Receipt receipt = {};
  std::uint64_t session = 0;  ///< as Client::session
};

/// One edit back, or forth again.
struct StepRequest {
  bool redo = false;
  std::optional<std::uint64_t> base_revision;
  std::string by;
  Receipt receipt = {};
  std::uint64_t session = 0;  ///< as Client::session
};

/// Errors of a patch: Error::where = JSON pointer; `operation` in PatchError is the index of the failing operation.
struct PatchOutcome {
  std::uint64_t revision = 0;
  std::uint64_t affected_surfaces = 0, affected_shots = 0;
  std::uint64_t stepped = 0;  ///< of undo and redo: the revision that the edit had made when it was new
};

/// What outlived earlier processes; all empty for an engine that keeps nothing.
struct Past {
  std::string epoch;                     ///< the same as long as revisions and tile versions go on
  std::uint64_t first_tile_version = 0;  ///< all of this process are larger
  /// Patches since the last load, oldest first: whoever is at `patches_from` or later can follow.
  struct Patch {
    std::uint64_t revision = 0;
    std::string patch, by;
  };
  std::uint64_t patches_from = 0;
  std::vector<Patch> patches;
  struct Answer {
    Receipt receipt;
    PatchOutcome outcome;
  };
  std::vector<Answer> answers;  ///< oldest first
};

/// How a revision came about.
struct PastRevision {
  enum class Kind { kLoad, kPatch, kUndo, kRedo };
  std::uint64_t revision = 0;
  Kind kind = Kind::kLoad;
  std::string by, summary;    ///< summary: the scene's name, or the patch's first operations; at most 200 bytes
  double time_s = 0.0;        ///< since 1970-01-01 UTC
  std::uint64_t stepped = 0;  ///< kUndo, kRedo: as in PatchOutcome
  bool undone = false;        ///< kPatch: taken back at present
};

struct HistoryReport {
  std::uint64_t revision = 0;
  std::uint64_t undoable = 0, redoable = 0;  ///< steps that can be taken either way
  std::vector<PastRevision> revisions;       ///< oldest first; the newest are kept
};

struct SnapshotRequest {
  std::string camera;  ///< name or index of a scene camera; empty: the first, or one that frames the scene
  int width = 960, height = 720;
  std::string quantity = "lit";    ///< lit, irradiance, radiosity, error, patchId, mipLevel, normal, unshot
  std::optional<double> exposure;  ///< 1/nit; none: measured
};

struct Snapshot {
  SharedBytes png;
  std::optional<double> exposure;  ///< 1/nit, what radiance was multiplied by; none: false colours
};

struct TexelRequest {
  std::uint32_t page = 0, x = 0, y = 0;  ///< of mip 0; row 0 is v = 0
};

/// What one texel of the lightmaps has, and the moment that it is of.
struct Texel {
  std::uint64_t revision = 0, tile_version = 0;
  glm::vec3 irradiance{0.0F}, error{0.0F};  ///< Quantity::kIrradiance, kError; lux
};

struct MeasureRequest {
  std::string plane;             ///< name of its node, or that one's index; empty: all
  bool daylight_factor = false;  ///< also under a CIE overcast sky, all lamps off
};

/// Of the points of a plane: lux, or percent for daylight factors. Errors are standard errors.
struct PlaneFigures {
  double mean = 0.0, mean_error = 0.0;
  double minimum = 0.0, minimum_error = 0.0, maximum = 0.0, maximum_error = 0.0;  ///< not biased by noise
  double median = 0.0;
  double uniformity = 0.0, uniformity_error = 0.0;  ///< minimum / mean
  double solve_error = 0.0;  ///< what the mean may be off by beyond that, since the solve has not ended, or by texels
  std::vector<double> light, error;  ///< by point, row by row
};

/// Whether a plane reaches what is asked of it, at a confidence of 95 %.
enum class PlaneVerdict { kPasses, kFails, kUndecided };

struct MeasuredPlane {
  std::uint32_t node = 0;
  std::string name;
  std::uint32_t columns = 0, rows = 0;
  std::array<glm::dvec3, 3> place{};  ///< first point, steps to the next column and to the next row; metres
  glm::dvec3 normal{0.0};
  std::optional<double> wanted_lux, wanted_uniformity;
  std::optional<PlaneVerdict> lux_verdict, uniformity_verdict, verdict;  ///< verdict: of both
  PlaneFigures illuminance;
  std::optional<PlaneFigures> daylight_factor;  ///< percent
};

/// The measuring planes of a moment.
struct MeasureReport {
  std::uint64_t revision = 0;
  SolveState state = SolveState::kEmpty;
  double error = 1.0;  ///< ErrorEstimate::total
  std::vector<MeasuredPlane> planes;
};

struct ProbeRequest {
  std::optional<double> spacing;  ///< metres: one grid over the whole scene; none: the grids of the document
  bool light = true;              ///< false: where probes are, without what they see
};

/// A grid of probes: (x, y, z) is number x + counts[0] (y + counts[1] z).
struct ProbeGridLight {
  std::optional<std::uint32_t> node;  ///< none: the whole scene
  std::string name;
  std::array<std::uint32_t, 3> counts{1, 1, 1};
  glm::dvec3 first{0.0};              ///< metres
  std::array<glm::dvec3, 3> steps{};  ///< to the next in x, y and z, metres
  std::vector<float> values;          ///< kProbeValues of each probe, one probe after the other; or none
};
/// Of a probe: nine coefficients of radiance, three channels each, nits x sr; their standard errors; distances to the
/// nearest surface about +X, -X, +Y, -Y, +Z, -Z, metres, and their mean squares; the least distance; the part of all
/// directions in which backs are met; 0, or, where the light is that of others, how many probes away they are (-1:
/// there are none).
inline constexpr std::size_t kProbeValues = 2 * 27 + 2 * 6 + 3;

/// The probes of a moment.
struct ProbeReport {
  std::uint64_t revision = 0;
  SolveState state = SolveState::kEmpty;
  double error = 1.0;  ///< ErrorEstimate::total
  std::vector<ProbeGridLight> grids;
};

/// The photometric web of a light of EXT_lights_ies, with few enough directions to be drawn.
struct ShownWeb {
  std::uint64_t revision = 0;
  double lumens = 0.0, most_candela = 0.0;
  glm::dvec3 axis{0.0}, across{0.0};  ///< in the node's space: polar angle 0, and azimuth 0 at polar angle 90
  std::vector<float> polar, azimuth;  ///< degrees; azimuths grow towards cross(across, axis)
  std::vector<float> candela;         ///< azimuth by azimuth
};

/// Something mended itself that those who watch may wonder about.
struct Notice {
  enum class Kind { kRendererReplaced, kSolveRestarted };
  Kind kind = Kind::kRendererReplaced;
  std::string text;
};

class Listener {
 public:
  virtual ~Listener() = default;
  virtual void onProgress(const Status& status) = 0;
  virtual void onScenePatched(std::uint64_t revision, const std::string& patch, const std::string& by) = 0;
  virtual void onSceneLoaded(std::uint64_t revision) = 0;
  virtual void onLightmaps(const std::shared_ptr<const Lightmaps>& lightmaps) = 0;
  virtual void onNotice(const Notice& /*notice*/) {}
};

class Engine {
 public:
  template <typename T>
  using Callback = std::function<void(Result<T>)>;

  virtual ~Engine() = default;

  /// `name` is for messages and file names ("room.glb"). The present scene stays, can be edited and is solved on until
  /// the new one is ready to take its place. kCancelled: the client has gone, another load came, or the end
  /// (callOff()); then the present scene stays for good. Edits by the client's own session wait for its load, and so
  /// does everything else that needs a scene where none is there yet.
  virtual void loadBytes(std::string name, SharedBytes bytes, Client client, Callback<LoadOutcome> done) = 0;
  virtual void loadFile(std::string path, Client client, Callback<LoadOutcome> done) = 0;
  /// The scene to start with: goes on with the one that outlived the last process, edits included, if there is one,
  /// with a warning where that was not loaded from the very same file; unless it is to be taken anew.
  virtual void openFile(std::string path, bool /*anew*/, Callback<LoadOutcome> done) {
    loadFile(std::move(path), {}, std::move(done));
  }
  virtual void patch(PatchRequest request, Callback<PatchOutcome> done) = 0;
  /// Takes the latest edit back that is not taken back, whoever made it, or makes it again. A new revision; kNotFound
  /// where there is none.
  virtual void step(StepRequest request, Callback<PatchOutcome> done) = 0;
  virtual void history(Callback<HistoryReport> done) = 0;
  /// Makes the settings that are to hold of those that hold when its turn comes. Called once, on the solve thread.
  using ChangeSettings = std::function<SolveSettings(SolveSettings)>;
  virtual void configure(ChangeSettings change, Callback<SolveSettings> done) = 0;
  virtual void pause(Callback<SolveState> done) = 0;
  virtual void resume(Callback<SolveState> done) = 0;
  virtual void restart(Callback<SolveState> done) = 0;

  [[nodiscard]] virtual Status status() const = 0;
  /// How the error has fallen since the present solve began, as listeners were told: at most kErrorSamples, about
  /// evenly in the logarithm of time.
  [[nodiscard]] virtual SolveHistory solveHistory() const = 0;
  /// How long the solve thread has been at its present slice or command; 0 while it waits for one. Slices take less
  /// than a second.
  [[nodiscard]] virtual double busySeconds() const = 0;

  /// Until the last of what this returns is let go, the quantity is published: now, and whenever it has changed. What
  /// nobody watches costs nothing.
  [[nodiscard]] virtual std::shared_ptr<void> watch(Quantity quantity) = 0;
  /// What was published last; nothing where nobody watches.
  [[nodiscard]] virtual std::shared_ptr<const Lightmaps> lightmaps(Quantity quantity) const = 0;
  [[nodiscard]] std::shared_ptr<const Lightmaps> lightmaps() const { return lightmaps(Quantity::kIrradiance); }

  /// The document as JSON text (buffers and images by URL), with its revision.
  struct SceneText {
    std::uint64_t revision = 0;
    std::string gltf;
  };
  virtual void sceneText(Callback<SceneText> done) = 0;

  // Files and pictures show the moment at which their turn comes. They are made one at a time, those of sessions in
  // turn, beside the solve and the edits. kCancelled: the client has gone, or the end is near (callOff()).
  /// GLB with TEXCOORD_1 and extras.lightmap on every lit primitive. `layout`: of that Lightmaps::layout, or
  /// kStaleRevision where pages are laid out otherwise by now (or not yet so, for a number of another process); none:
  /// as it is.
  virtual void sceneGlb(std::optional<std::uint64_t> layout, Client client, Callback<SharedBytes> done) = 0;
  /// GLB with KHR_materials_unlit textures, tone-mapped.
  virtual void unlitGlb(Client client, Callback<SharedBytes> done) = 0;
  /// The sky as Radiance HDR, equirectangular, nits. kNotFound: there is none, or it is two colours.
  virtual void skyPicture(Client /*client*/, Callback<SharedBytes> done) {
    done(fail(ErrorCode::kNotFound, "the sky is no picture"));
  }
  /// Of the light of this index in EXT_lights_ies. kNotFound: there is none.
  virtual void lightWeb(std::size_t /*light*/, Client /*client*/, Callback<ShownWeb> done) {
    done(fail(ErrorCode::kNotFound, "there is no such light"));
  }
  /// OpenEXR, row 0 = v 0: 32-bit float RGB, or one channel "Y" of 32-bit whole numbers.
  virtual void lightmapExr(std::uint32_t page, Quantity quantity, Client client, Callback<SharedBytes> done) = 0;
  virtual void snapshot(SnapshotRequest request, Client client, Callback<Snapshot> done) = 0;
  /// kNotFound where there is no such texel, or it belongs to no surface: Error::where is "page", "x" or "y". May be
  /// asked often, by many: what it takes is made for all of them together, and seldom while the solve goes on; of a
  /// layout that has just come kBusy instead.
  virtual void texel(TexelRequest request, Callback<Texel> done) = 0;

  /// Illuminance on the scene's measuring planes, as pictures are made. kNotFound: there is no plane of that name, and
  /// Error::where is "plane".
  virtual void measure(MeasureRequest /*request*/, Client /*client*/, Callback<MeasureReport> done) {
    done(MeasureReport{});
  }

  /// Light at grids of probes, as pictures are made: what they see is found once, and only summed up again while the
  /// geometry stays. kNotFound: the document has no grid. kTooLarge, and Error::where is "spacing": too many probes.
  virtual void probes(ProbeRequest /*request*/, Client /*client*/, Callback<ProbeReport> done) { done(ProbeReport{}); }

  /// The same from the engine's start to its end.
  [[nodiscard]] virtual const Past& past() const {
    static const Past kNothing;
    return kNothing;
  }
  /// The end is near: calls off the load, the pictures and the files under way, and refuses others, with kCancelled.
  virtual void callOff() {}
  /// The end is near: brings what was solved so far to the disk, where state is kept. Blocks, at most so long; then the
  /// last checkpoint stays.
  virtual void keepSolve(std::chrono::milliseconds /*patience*/) {}

  /// Kept by weak pointer; a listener that is gone is forgotten. Lightmaps come only while someone watches.
  virtual void addListener(std::weak_ptr<Listener> listener) = 0;
};

}  // namespace radiosity::engine
