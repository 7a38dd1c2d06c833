#include "client/cli/remote.h"

#include <fmt/format.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <optional>

#include "client/cli/interrupt.h"
#include "client/cli/ktx2.h"
#include "client/cli/scene_file.h"
#include "protocol/http_bodies.h"

namespace radiosity::cli {
namespace {

constexpr unsigned kMaxPages = 4096;
constexpr int kSaveAttempts = 3;
constexpr std::size_t kMaxErrorTextBytes = 500;

Result<std::string> readToken(const std::string& path) {
  if (path.empty()) return std::string();
  std::ifstream file(path, std::ios::binary);
  if (!file) return fail(ErrorCode::kBadUsage, "the token file cannot be read", path);
  std::string token(protocol::kMaxTokenBytes + 1, '\0');
  file.read(token.data(), static_cast<std::streamsize>(token.size()));
  token.resize(static_cast<std::size_t>(file.gcount()));
  const auto end = token.find_last_not_of(" \t\r\n");
  token.resize(end == std::string::npos ? 0 : end + 1);
  if (token.empty()) return fail(ErrorCode::kBadUsage, "the token file is empty", path);
  if (token.size() > protocol::kMaxTokenBytes) return fail(ErrorCode::kBadUsage, "the token is over 4096 bytes", path);
  if (token.find_first_of("\r\n") != std::string::npos)
    return fail(ErrorCode::kBadUsage, "the token file must hold one line", path);
  return token;
}

/// How far a transfer is, for the progress line.
client::TransferProgress showTransfer(ProgressDisplay& display, std::string what) {
  return [&display, what = std::move(what)](std::uint64_t done_bytes, std::uint64_t total_bytes) {
    display.showText(fmt::format("{} {}", what, transferText(done_bytes, total_bytes)));
  };
}

/// GET into a new file; no value where the server says 404.
Result<std::optional<client::AtomicFile>> download(const Remote& remote, const std::string& target,
                                                   const std::string& path, ProgressDisplay& display) {
  auto file = client::AtomicFile::create(path);
  if (!file) return tl::unexpected(file.error());
  auto http = remote.http();
  http.progress = showTransfer(display, "writing " + path);
  const auto reply = client::httpGetToFile(http, target, *file);
  if (!reply) return tl::unexpected(reply.error());
  if (reply->status == 404) return std::optional<client::AtomicFile>();
  if (!reply->ok()) return tl::unexpected(httpError(*reply, target));
  return std::optional<client::AtomicFile>(std::move(*file));
}

/// Every page of a quantity, as "STEM.<what>.<page>.exr".
Result<void> downloadPages(const Remote& remote, const std::string& quantity, const std::string& stem,
                           ProgressDisplay& display, std::vector<client::AtomicFile>& files) {
  for (unsigned page = 0; page < kMaxPages; ++page) {
    auto exr = download(remote, fmt::format("/lightmaps/{}.exr?quantity={}", page, quantity),
                        fmt::format("{}.{}.exr", stem, page), display);
    if (!exr) return tl::unexpected(exr.error());
    if (!*exr) break;  // past the last page
    files.push_back(std::move(**exr));
  }
  return {};
}

Result<std::vector<client::AtomicFile>> downloadAll(const Remote& remote, const SaveRequest& request,
                                                    const std::string& stem, ProgressDisplay& display) {
  std::vector<client::AtomicFile> files;
  const std::string glb_target = request.unlit ? "/scene-unlit.glb" : "/scene.glb";
  auto glb = download(remote, glb_target, request.glb_path, display);
  if (!glb) return tl::unexpected(glb.error());
  if (!*glb) return fail(ErrorCode::kNotFound, "the server has no scene to save yet", remote.url.text());
  files.push_back(std::move(**glb));
  if (auto done = downloadPages(remote, "irradiance", stem + ".lightmap", display, files); !done)
    return tl::unexpected(done.error());
  if (request.error_map) {
    if (auto done = downloadPages(remote, "error", stem + ".error", display, files); !done)
      return tl::unexpected(done.error());
  }
  if (!request.png_path.empty()) {
    auto png = download(remote, "/snapshot.png", request.png_path, display);
    if (!png) return tl::unexpected(png.error());
    if (!*png) return fail(ErrorCode::kNotFound, "the server has no picture of this scene", remote.url.text());
    files.push_back(std::move(**png));
  }
  return files;
}

/// What UVs and pages that belong together have in common: other texels make another layout of the same revision.
struct Layout {
  std::uint64_t revision = 0, texels = 0, patches = 0;
  double texel_size_m = 0.0;
  bool operator==(const Layout&) const = default;
};

/// Waits while a scene is loaded: what a server shows of it until then are fewer texels, with pages of their own.
Result<Layout> currentLayout(const Remote& remote) {
  auto connection = remote.connect();
  if (!connection) return tl::unexpected(connection.error().error);
  while (!interrupted()) {
    const auto status = connection->call(protocol::StatusCall{});
    if (!status) return tl::unexpected(status.error().error);
    if (status->progress.state != "loading")
      return Layout{status->progress.revision, status->settings.texels, status->progress.patches,
                    status->settings.texel_size_m};
    if (auto polled = connection->poll(std::chrono::milliseconds(200)); !polled) return tl::unexpected(polled.error());
  }
  return fail(ErrorCode::kUnavailable, "interrupted");
}

}  // namespace

void addAccessOptions(CLI::App& command, RemoteOptions& options) {
  command.add_option("--token-file", options.token_file, "file that holds the server's token")->type_name("FILE");
  command
      .add_option("--ca", options.trust.ca_file,
                  "PEM file of the authorities, or of the self-signed certificate, to trust with https://; default: "
                  "those of this machine")
      ->type_name("FILE");
  command.add_flag("--insecure{false}", options.trust.verify,
                   "with https://: take any certificate (whoever is in between can read and change all)");
}

void addRemoteOptions(CLI::App& command, RemoteOptions& options) {
  command.add_option("URL", options.url, "the server: HOST:PORT, http://HOST:PORT or https://HOST:PORT")
      ->required()
      ->type_name("");
  addAccessOptions(command, options);
}

client::CallResult<client::Connection> Remote::connect() const {
  return client::Connection::open(
      {.url = url, .trust = trust, .client = "radiosity/0.1.0", .token = token, .keep_going = keep_going});
}

Result<Remote> remoteFrom(const RemoteOptions& options) {
  auto url = client::parseServerUrl(options.url);
  if (!url) return tl::unexpected(url.error());
  auto token = readToken(options.token_file);
  if (!token) return tl::unexpected(token.error());
  return Remote{*url, options.trust, *token, [] { return !interrupted(); }};
}

Error httpError(const client::HttpReply& reply, const std::string& where) {
  Error error = protocol::decodeHttpError(static_cast<int>(reply.status), reply.body);
  error.message.resize(std::min(error.message.size(), kMaxErrorTextBytes));
  if (reply.status == 401 || reply.status == 403) error.message += " (is the token right? --token-file)";
  if (reply.status == 503) error.code = ErrorCode::kBusy;
  // The server knows the upload by its file name; we know where the file lies.
  const std::string name = std::filesystem::path(where).filename().string();
  if (error.where.empty() || error.where == name) {
    error.where = where;
  } else if (error.where.starts_with(name + ":")) {
    error.where = where + error.where.substr(name.size());
  } else {
    error.where = where + ": " + error.where;
  }
  return error;
}

Result<Loaded> uploadScene(const Remote& remote, const std::string& path, const SkyChoice& sky,
                           ProgressDisplay& display) {
  const auto kind = sceneKind(path);
  if (!kind) return tl::unexpected(kind.error());
  const auto scene = withoutKtx2(path);
  if (!scene) return tl::unexpected(scene.error());
  auto http = remote.http();
  http.progress = showTransfer(display, "uploading " + path);
  const std::string target = "/scene?name=" + client::percentEncode(std::filesystem::path(path).filename().string());
  Result<client::HttpReply> reply = client::HttpReply{};
  if (sky.isOfScene()) {
    auto made = withSky(scene->path(), sky);
    if (!made) return tl::unexpected(made.error());
    reply = client::httpPutText(http, target, made->is_glb ? "model/gltf-binary" : "model/gltf+json",
                                std::move(made->bytes));
  } else if (*kind == SceneKind::kGlb) {
    reply = client::httpPutFile(http, target, "model/gltf-binary", scene->path());
  } else {
    auto text = inlineExternalFiles(scene->path());
    if (!text) return tl::unexpected(text.error());
    reply = client::httpPutText(http, target, "model/gltf+json", std::move(*text));
  }
  if (!reply) return tl::unexpected(reply.error());
  if (!reply->ok()) return tl::unexpected(httpError(*reply, path));
  auto loaded = protocol::decodeHttpLoad(reply->body);
  if (!loaded)
    return fail(ErrorCode::kUnavailable, "the answer to the upload: " + loaded.error().text(), remote.url.text());
  return Loaded{loaded->revision, std::move(loaded->warnings)};
}

Result<std::string> glbStem(const std::string& path) {
  constexpr std::string_view kEnding = ".glb";
  if (path.size() <= kEnding.size() || !path.ends_with(kEnding) || path[path.size() - kEnding.size() - 1] == '/')
    return fail(ErrorCode::kBadUsage,
                "the output's name must end with .glb (lightmaps become NAME.lightmap.0.exr, ...)", path);
  return path.substr(0, path.size() - kEnding.size());
}

Result<void> checkOutputs(const std::vector<std::string>& paths) {
  for (const auto& path : paths) {
    if (path.empty()) continue;
    if (auto probe = client::AtomicFile::create(path); !probe) return tl::unexpected(probe.error());
  }
  return {};
}

Result<std::vector<std::string>> saveScene(const Remote& remote, const SaveRequest& request, ProgressDisplay& display) {
  const auto stem = glbStem(request.glb_path);
  if (!stem) return tl::unexpected(stem.error());
  for (int attempt = 0; attempt < kSaveAttempts; ++attempt) {
    const auto before = currentLayout(remote);
    if (!before) return tl::unexpected(before.error());
    auto files = downloadAll(remote, request, *stem, display);
    if (!files) return tl::unexpected(files.error());
    const auto after = currentLayout(remote);
    if (!after) return tl::unexpected(after.error());
    if (*before != *after) continue;  // somebody changed it in between: UVs and pages might not belong together
    std::vector<std::string> names;
    for (auto& file : *files) {
      if (auto done = file.commit(); !done) return tl::unexpected(done.error());
      names.push_back(file.path());
    }
    return names;
  }
  return fail(ErrorCode::kBusy, "the scene is being changed faster than it can be downloaded; try again",
              remote.url.text());
}

}  // namespace radiosity::cli
