#include "client/cli/engine_output.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <sstream>
#include <utility>

#include "client/cli/child_process.h"
#include "client/cli/exit_code.h"
#include "client/cli/staged_folder.h"
#include "client/engines/engine.h"
#include "client/engines/lit_scene.h"

namespace radiosity::cli {
namespace {

namespace fs = std::filesystem;

/// The scene as it is on the server. Its files go when they are read.
Result<engines::LitScene> downloadLit(const Remote& remote, const EngineRequest& request, const StagedFolder& folder,
                                      ProgressDisplay& display) {
  const auto glb = folder.stagedPath("lit.glb");
  auto names =
      saveScene(remote, {.glb_path = glb, .unlit = false, .png_path = request.png_path, .error_map = false}, display);
  if (!names) return tl::unexpected(folder.placed(names.error()));
  std::erase_if(*names, [&](const auto& name) { return name == glb || name == request.png_path; });
  auto scene = engines::readLitScene(glb, *names);
  if (!scene) return tl::unexpected(folder.placed(scene.error()));
  std::error_code ignored;
  fs::remove(glb, ignored);
  for (const auto& name : *names) fs::remove(name, ignored);
  return scene;
}

/// The line of a Python program's output that tells what went wrong ("ValueError: ..."), or its last one.
std::string complaintIn(const std::string& text) {
  std::istringstream lines(text);
  std::string line, last, complaint;
  while (std::getline(lines, line)) {
    if (line.find_first_not_of(" \t") == std::string::npos) continue;
    last = line;
    if (line.find("Error: ") != std::string::npos && !line.starts_with("Error: ")) complaint = line;
  }
  return complaint.empty() ? last : complaint;
}

/// Whether Blender was there to make scene.blend.
Result<bool> makeBlend(const StagedFolder& folder, ProgressDisplay& display) {
  display.showText("making scene.blend");
  const auto ran = runProgram({"blender", "--background", "--factory-startup", "--python-exit-code", "1", "--python",
                               folder.stagedPath("make_blend.py")});
  if (!ran) return tl::unexpected(ran.error());
  if (ran->exit_code == kNoProgram) return false;
  std::error_code error;
  if (ran->exit_code == 0 && fs::exists(folder.stagedPath("scene.blend"), error)) return true;
  return fail(ErrorCode::kUnavailable, "Blender could not make scene.blend: " + complaintIn(ran->text));
}

std::string noteOf(const engines::Engine& engine, const engines::Exported& exported, const std::string& folder,
                   std::string_view next) {
  std::string note = fmt::format("{} loses {} of the light (RMS)\n", engines::encodingText(engine.encoding),
                                 percentText(exported.loss));
  if (exported.baked > 0)
    note += fmt::format("{} lamp{} taken out: {} light is in the lightmaps\n", exported.baked,
                        exported.baked == 1 ? "" : "s", exported.baked == 1 ? "its" : "their");
  return note + fmt::format("to see it in {}: cd {} && {}", engine.title, folder, next);
}

}  // namespace

CLI::Option* addEngineOption(CLI::App& command, std::string& engine) {
  const auto known = [](const std::string& name) {
    if (engines::findEngine(name) != nullptr) return std::string();
    return fmt::format("{} is no engine that scenes are written for; these are: {}", name,
                       fmt::join(engines::engineNames(), ", "));
  };
  return command
      .add_option(
          "--for", engine,
          fmt::format("OUT is a folder that this engine shows as it is: {}", fmt::join(engines::engineNames(), ", ")))
      ->check(CLI::Validator(known, ""))
      ->type_name("ENGINE");
}

Result<void> checkEngineFolder(const std::string& folder) {
  const auto probe = StagedFolder::open(folder);
  if (!probe) return tl::unexpected(probe.error());
  return {};
}

Result<EngineSaved> saveForEngine(const Remote& remote, const EngineRequest& request, const engines::StatedError& error,
                                  ProgressDisplay& display) {
  const auto* engine = engines::findEngine(request.engine);
  if (engine == nullptr) return fail(ErrorCode::kBadUsage, "no engine of this name is known", request.engine);
  auto folder = StagedFolder::open(request.folder);
  if (!folder) return tl::unexpected(folder.error());
  auto scene = downloadLit(remote, request, *folder, display);
  if (!scene) return tl::unexpected(scene.error());
  display.showText("writing " + request.folder);
  const auto exported = engines::exportFor(*engine, std::move(*scene), error);
  if (!exported) return tl::unexpected(exported.error());
  std::vector<std::string> names;
  for (const auto& file : exported->files) {
    if (auto done = folder->write(file.name, file.bytes); !done) return tl::unexpected(done.error());
    names.push_back(file.name);
  }
  std::string_view next = engine->next;
  if (engine->name == "blender") {
    const auto made = makeBlend(*folder, display);
    if (!made) return tl::unexpected(made.error());
    if (*made) names.emplace_back("scene.blend");
    if (!*made) next = "blender --background --factory-startup --python make_blend.py  (Blender was not found here)";
  }
  auto paths = folder->commit(names);
  if (!paths) return tl::unexpected(paths.error());
  return EngineSaved{std::move(*paths), noteOf(*engine, *exported, request.folder, next)};
}

}  // namespace radiosity::cli
