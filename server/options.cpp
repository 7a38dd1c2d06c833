#include "server/options.h"

#include <CLI/CLI.hpp>
#include <charconv>
#include <cstdio>
#include <fstream>
#include <utility>

#include "protocol/sky.h"

namespace radiosity {
namespace {

struct Raw {
  std::string listen = "127.0.0.1:8765", token_file, sky, log_format = "text";
  double time_limit_s = 0.0;
};

/// "127.0.0.1:8765", "[::1]:0".
Result<void> readListen(const std::string& text, net::ServerOptions& server) {
  const auto colon = text.rfind(':');
  const auto port = colon == std::string::npos ? std::string() : text.substr(colon + 1);
  auto address = text.substr(0, colon);
  if (address.starts_with('[') && address.ends_with(']')) address = address.substr(1, address.size() - 2);
  const auto [end, error] = std::from_chars(port.data(), port.data() + port.size(), server.port);
  if (port.empty() || address.empty() || error != std::errc() || end != port.data() + port.size())
    return fail(ErrorCode::kBadUsage, "must be ADDRESS:PORT, for example 127.0.0.1:8765", "--listen " + text);
  server.address = address;
  return {};
}

/// The first line, without white space around it.
Result<std::string> readToken(const std::string& path) {
  std::ifstream file(path);
  std::string token;
  if (!std::getline(file, token))
    return fail(ErrorCode::kBadUsage, "cannot be read, or is empty", "--token-file " + path);
  const auto first = token.find_first_not_of(" \t\r");
  const auto last = token.find_last_not_of(" \t\r");
  token = first == std::string::npos ? std::string() : token.substr(first, last - first + 1);
  if (token.size() < 16 || token.size() > protocol::kMaxTokenBytes)
    return fail(ErrorCode::kBadUsage, "a token needs 16 to 4096 characters (try: openssl rand -hex 32)",
                "--token-file " + path);
  return token;
}

void addSolveOptions(CLI::App& app, Options& o, Raw& raw) {
  app.add_option("--error", o.solve.target_error,
                 "Stop when light is this far off where people look, relative RMS (0.02 = 2 %); with texels of one "
                 "size: on texels")
      ->check(CLI::Range(1e-9, 1.0))
      ->capture_default_str();
  app.add_option("--time-limit", raw.time_limit_s, "Stop after this many seconds of solving; 0: no limit")
      ->check(CLI::Range(0.0, 1e9))
      ->capture_default_str();
  app.add_option("--texels", o.solve.texels,
                 "Lightmap texels (leaf patches) that there may be (1000000 unless named), or, of one size, in all, "
                 "about (24000)")
      ->check(CLI::PositiveNumber);
  app.add_option("--texel-size", o.solve.texel_size_m, "Side of a texel in metres; 0: from --texels")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app.add_option("--first-texels", o.first_texels,
                 "Of a scene of more than a million texels, light so many first, for those who watch, while the others "
                 "are being made; 0: none")
      ->capture_default_str();
  app.add_option("--seed", o.solve.seed, "Seed of the sampling; the same seed gives the same bits")
      ->capture_default_str();
  app.add_option("--workers", o.workers,
                 "Renderer processes; 0: one for each core in software, one on a GPU, with a thread for each core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  app.add_option(
         "--visibility", o.sight,
         "How it is found out what a light sees: by rays, by images, or measured: both are tried in a small room at "
         "start-up. auto: by rays where the processor draws, on a GPU as measured")
      ->transform(CLI::CheckedTransformer(std::map<std::string, gpu::Sight>{{"auto", gpu::Sight::kAuto},
                                                                            {"rays", gpu::Sight::kRays},
                                                                            {"images", gpu::Sight::kImages},
                                                                            {"measured", gpu::Sight::kMeasured}})
                      .description("{auto,rays,images,measured}"))
      ->default_str("auto");
  app.add_option("--sky", raw.sky,
                 "Radiance of everything outside the scene, nits: 1000, or R,G,B, or R,G,B/R,G,B (above / below the "
                 "horizon); for scenes without a sky of their own")
      ->type_name("NITS");
  app.add_flag(
      "--double-sided", o.solve.double_sided,
      "Light both sides of all surfaces, whatever their materials say: for rooms whose faces are turned outward");
  o.solve.adaptive = true;
  app.add_flag("--uniform{false}", o.solve.adaptive,
               "Texels of one size everywhere, --texels of them. Without it, and without --texel-size, the server "
               "chooses them, as few as meet the target where people look, finer where light wants it");
  app.add_flag(
      "--means", o.solve.texels_are_means,
      "Texels of lightmaps hold the mean light of what they cover, for those who filter them in a way of their "
      "own. Without it they hold what bilinear lookups come closest to the light with");
  app.add_option(
         "--link-memory", o.solve.link_memory_bytes,
         "Memory for remembered links and rays, bytes (suffixes KiB, MiB, GiB); a solve that has used it up ends above "
         "its target error; a scene whose rays do not fit, as with 0, is solved by averaged shooting")
      ->transform(CLI::AsSizeValue(false))
      ->capture_default_str();
  app.add_option("--max-scene-memory", o.max_scene_bytes,
                 "Memory that a scene may claim, bytes (suffixes KiB, MiB, GiB): what its file, or an edit, names in "
                 "vertices, instances, triangles and pictures is summed up before any of it is made; 0: a quarter of "
                 "the memory there is")
      ->transform(CLI::AsSizeValue(false))
      ->type_name("SIZE")
      ->capture_default_str();
  app.add_option("--method", o.solve.method,
                 "gather: texels gather reflected light along rays; shooting: progressive shooting, which remembers no "
                 "links; paper: Lum, Ma and Max 2002, for comparisons")
      ->transform(CLI::CheckedTransformer(std::map<std::string, Method>{{"gather", Method::kGather},
                                                                        {"shooting", Method::kShooting},
                                                                        {"paper", Method::kPaper}})
                      .description("{gather,shooting,paper}"))
      ->default_str("gather");
}

void addStateOptions(CLI::App& app, Options& o) {
  app.add_option(
         "--state", o.state,
         "Folder of what outlives the server: scene, edits, settings, uploads, checkpoints of the solve. An edit "
         "is answered once it is on the disk, and refused while the folder is not where it was opened. Made if it is "
         "missing; one server at a time. The scene in it goes before SCENE, unless --reload")
      ->type_name("DIR");
  app.add_flag("--reload", o.reload, "Take SCENE though --state holds a scene; that one and its edits are forgotten");
  app.add_option("--checkpoint-size", o.checkpoint_bytes,
                 "Largest checkpoint of a solve in --state, bytes (suffixes KiB, MiB, GiB); a solve that needs more "
                 "begins anew after a restart; 0: none")
      ->transform(CLI::AsSizeValue(false))
      ->capture_default_str();
}

/// Settings of the command line go before those that a client made earlier.
std::set<std::string> namedSettings(const CLI::App& app) {
  std::set<std::string> named;
  const auto note = [&](const char* option, const char* setting) {
    if (app.count(option) > 0) named.insert(setting);
  };
  note("--error", "targetError");
  note("--time-limit", "timeLimit");
  note("--texels", "texels");
  note("--texel-size", "texels");
  note("--uniform", "adaptive");
  note("--seed", "seed");
  note("--sky", "sky");
  note("--double-sided", "doubleSided");
  note("--method", "method");
  return named;
}

void addServerOptions(CLI::App& app, Options& o, Raw& raw) {
  app.add_option("--listen", raw.listen, "ADDRESS:PORT of HTTP and WebSocket; port 0: any free one, printed on stdout")
      ->capture_default_str();
  app.add_option("--token-file", raw.token_file, "File whose first line every client must present as bearer token");
  addStateOptions(app, o);
  app.add_flag("--insecure", o.server.insecure, "Listen beyond this machine without a token");
  auto* certificate =
      app.add_option("--tls-cert", o.server.tls_certificate,
                     "PEM file with the certificate (and those above it): speak TLS 1.2 and 1.3 only, https:// and "
                     "wss://. SIGHUP reads it again");
  auto* key = app.add_option("--tls-key", o.server.tls_key, "PEM file with the certificate's private key, unencrypted");
  certificate->needs(key)->type_name("FILE");
  key->needs(certificate)->type_name("FILE");
  app.add_option("--allow-origin", o.server.allow_origins,
                 "Let web pages of this origin in, beside the server's own (https://viewer.example.org); repeatable");
  app.add_option("--scene-root", o.server.scene_root, "Folder from which clients may load scenes as file:NAME")
      ->check(CLI::ExistingDirectory);
  app.add_option("--max-upload", o.server.max_upload_bytes, "Largest upload, bytes (suffixes KiB, MiB, GiB)")
      ->transform(CLI::AsSizeValue(false))
      ->capture_default_str();
  app.add_option("--max-clients", o.server.max_clients, "Connections at a time")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  app.add_option("--log-level", o.log_level, "debug, info, warn, error or off; the log goes to stderr")
      ->check(CLI::IsMember({"debug", "info", "warn", "error", "off"}))
      ->capture_default_str();
  app.add_option("--log-format", raw.log_format,
                 "text, or json: one object a line, with time, level, message, revision and requestId")
      ->check(CLI::IsMember({"text", "json"}))
      ->capture_default_str();
}

Result<void> finish(Options& o, const Raw& raw) {
  if (raw.time_limit_s > 0.0) o.solve.time_limit_s = raw.time_limit_s;
  if (!raw.sky.empty()) {
    const auto sky = protocol::parseSky(raw.sky);
    if (!sky) return tl::unexpected(sky.error());
    const auto color = [](const std::array<double, 3>& c) { return glm::vec3(c[0], c[1], c[2]); };
    o.solve.sky = {color(sky->upper), color(sky->lower)};
  }
  o.log_format = raw.log_format == "json" ? LogFormat::kJson : LogFormat::kText;
  if (auto listen = readListen(raw.listen, o.server); !listen) return listen;
  if (raw.token_file.empty()) return {};
  auto token = readToken(raw.token_file);
  if (!token) return tl::unexpected(std::move(token.error()));
  o.server.token = std::move(*token);
  return {};
}

}  // namespace

ParsedOptions parseOptions(int argc, const char* const* argv, const std::string& version) {
  ParsedOptions parsed;
  auto& options = parsed.options;
  options.server.version = version;
  Raw raw;
  CLI::App app{"radiosityd computes global illumination and streams the lightmaps as they sharpen.", "radiosityd"};
  app.set_version_flag("--version", "radiosityd " + version);
  app.add_option("SCENE", options.scene, "glTF scene (.glb or .gltf) to start with; clients can send others");
  addSolveOptions(app, options, raw);
  addServerOptions(app, options, raw);
  app.footer("Exit codes: 0 stopped by a signal, 1 failed, 2 bad usage or bad input.");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    parsed.exit_code = app.exit(error) == 0 ? 0 : kExitBadUsage;
    return parsed;
  }
  options.named_settings = namedSettings(app);
  if (app.count("--texels") == 0) options.solve.texels = options.solve.usualTexels();
  if (const auto finished = finish(options, raw); !finished) {
    std::fprintf(stderr, "radiosityd: %s\n", finished.error().text().c_str());
    parsed.exit_code = kExitBadUsage;
  }
  return parsed;
}

int exitCodeOf(const Error& error) {
  switch (error.code) {
    case ErrorCode::kBadUsage:
    case ErrorCode::kBadInput:
    case ErrorCode::kInvalidScene:
    case ErrorCode::kUnsupported:
    case ErrorCode::kNotFound:
    case ErrorCode::kTooLarge:
      return kExitBadUsage;
    default:
      return kExitFailed;
  }
}

}  // namespace radiosity
