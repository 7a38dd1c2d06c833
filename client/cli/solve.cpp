// The command lines of radiosity solve and measure.
#include <memory>

#include "client/cli/engine_output.h"
#include "client/cli/progress_line.h"
#include "client/cli/report.h"
#include "client/cli/solve_run.h"

namespace radiosity::cli {
namespace {

void addOutputOptions(CLI::App& command, SolveOptions& options) {
  command.add_option("SCENE", options.scene, "the scene: .glb, or .gltf with its files beside it")
      ->required()
      ->type_name("");
  command.add_option("--measure", options.measure.csv, "also the points of the scene's measuring planes, as CSV")
      ->type_name("FILE");
  addProbeOptions(command, options.probes, "--probes", "--probes-out");
  command
      .add_option("-o,--output", options.output,
                  "the scene with lightmap UVs; lightmaps go to NAME.lightmap.<page>.exr beside it")
      ->required()
      ->type_name("OUT.glb");
  auto* unlit =
      command.add_flag("--unlit", options.unlit, "OUT.glb shows the tone-mapped result in any glTF viewer instead");
  auto* error_map = command.add_flag("--error-map", options.error_map,
                                     "also the standard error of each texel, in lux: NAME.error.<page>.exr");
  addEngineOption(command, options.engine)->excludes(unlit)->excludes(error_map);
  command.add_option("--png", options.png, "also a picture from the scene's camera, or from one that frames it")
      ->type_name("FILE");
  command.add_option("--report", options.report, "also figures about the solve, as JSON")->type_name("FILE");
}

/// How to solve, and where.
void addSolvingOptions(CLI::App& command, SolveOptions& of) {
  auto* options = &of;
  command
      .add_option(
          "--error", options->error,
          "target: relative RMS error of light where people look, 0.02 is 2 %; with texels of one size: on texels")
      ->check(CLI::Range(1e-6, 1.0).description(""))
      ->type_name("FRACTION")
      ->capture_default_str();
  command
      .add_option("--time-limit", options->time_limit_s, "solving stops after this many seconds (default: no limit)")
      ->check(CLI::Range(0.001, 1e6).description(""))
      ->type_name("SECONDS");
  auto* texels = command
                     .add_option("--texels", options->texels,
                                 "lightmap texels (leaf patches) that there may be (default: 1000000), or, of one "
                                 "size, in all, about (24000)")
                     ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1} << 28U).description(""))
                     ->type_name("COUNT");
  command.add_option("--texel-size", options->texel_size_m, "side of a texel in metres, instead of --texels")
      ->check(CLI::Range(1e-6, 1e6).description(""))
      ->type_name("METRES")
      ->excludes(texels);
  command.add_flag("--means", options->means,
                   "texels hold the mean light of what they cover, not what bilinear lookups are closest with");
  command.add_flag("--uniform", options->uniform,
                   "texels of one size everywhere, on which --error is met; without it, and without --texel-size, "
                   "texels are chosen, as few as meet --error where people look, finer where light wants it");
  command.add_option("--seed", options->seed, "the same seed gives the same bits")
      ->type_name("N")
      ->capture_default_str();
  command.add_flag("--double-sided", options->double_sided,
                   "light both sides of all surfaces, whatever their materials say: for rooms whose faces are turned "
                   "outward");
  command
      .add_option(
          "--method", options->method,
          "gather: texels gather reflected light along rays; shooting: progressive shooting, which remembers no "
          "links; paper: Lum, Ma and Max 2002, whose sampling error is what it is (default: gather)")
      ->transform(CLI::CheckedTransformer(std::map<std::string, Method>{{"gather", Method::kGather},
                                                                        {"shooting", Method::kShooting},
                                                                        {"paper", Method::kPaper}})
                      .description(""))
      ->type_name("METHOD");
  addSkyOptions(command, options->sky);
  auto* workers =
      command.add_option("--workers", options->workers, "render processes of the private server (default: one a core)")
          ->check(CLI::Range(1U, 256U).description(""))
          ->type_name("N");
  auto* visibility = command
                         .add_option("--visibility", options->visibility,
                                     "how the private server finds out what a light sees: rays, images, measured (both "
                                     "are tried at start-up) or auto (default: rays where the processor draws, "
                                     "measured on a GPU)")
                         ->check(CLI::IsMember({"rays", "images", "measured", "auto"}).description(""))
                         ->type_name("HOW");
  auto* memory = command
                     .add_option("--link-memory", options->link_memory,
                                 "memory for links and rays of the private server, such as 256MiB (default: 1GiB); "
                                 "when it is used up the solve ends above its error")
                     ->check(CLI::AsSizeValue(false).description(""))
                     ->type_name("SIZE");
  auto* scene_memory =
      command
          .add_option("--max-scene-memory", options->max_scene_memory,
                      "memory that the scene may claim, such as 2GiB (default: a quarter of what there is); a file "
                      "that names more is refused before any of it is made")
          ->check(CLI::AsSizeValue(false).description(""))
          ->type_name("SIZE");
  auto* state = command
                    .add_option("--state", options->state,
                                "folder (made if missing) that an interrupted solve is kept in: Ctrl-C, SIGTERM or "
                                "SIGHUP ends it within 5 s with status 75, and the same command goes on from there, "
                                "to the same output")
                    ->type_name("DIR");
  command.add_option("--server", options->server.url, "solve there rather than on a private radiosityd")
      ->type_name("URL")
      ->excludes(workers)
      ->excludes(visibility)
      ->excludes(memory)
      ->excludes(scene_memory)
      ->excludes(state);
  addAccessOptions(command, options->server);
  command.add_flag("-q,--quiet", options->quiet, "no progress on stderr");
}

ExitCode solve(SolveOptions options) {
  options.measure.wanted = !options.measure.csv.empty();
  return solveScene(options);
}

/// Of a scene that is solved for it, or else of a server's as it is now.
ExitCode measure(SolveOptions options) {
  options.measure.wanted = true;
  if (!options.scene.empty()) return solveScene(options);
  if (options.server.url.empty()) return complain(Error{ErrorCode::kBadUsage, "name a SCENE, or a --server", {}});
  const auto remote = remoteFrom(options.server);
  if (!remote) return complain(remote.error());
  if (auto ready = checkOutputs({options.measure.csv, options.measure.json}); !ready) return complain(ready.error());
  ProgressDisplay display(options.quiet);
  const auto measured = measurePlanes(*remote, options.measure, display);
  if (!measured) return complain(measured.error());
  std::fputs(measured->c_str(), stdout);
  return ExitCode::kOk;
}

}  // namespace

void addSolve(CLI::App& app, Run& run) {
  auto options = std::make_shared<SolveOptions>();
  auto& command = *app.add_subcommand("solve", "solve a scene and write its lightmaps");
  addOutputOptions(command, *options);
  addSolvingOptions(command, *options);
  command.callback([options, &run] { run = [options] { return solve(*options); }; });
}

void addMeasure(CLI::App& app, Run& run) {
  auto options = std::make_shared<SolveOptions>();
  auto& command = *app.add_subcommand(
      "measure",
      "tell illuminance, uniformity and daylight factor on a scene's measuring planes (extras.radiosityPlane)");
  command
      .add_option("SCENE", options->scene, "the scene, which is solved for it (default: that of --server as it is now)")
      ->type_name("");
  addMeasureOptions(command, options->measure);
  addSolvingOptions(command, *options);
  command.callback([options, &run] { run = [options] { return measure(*options); }; });
}

}  // namespace radiosity::cli
