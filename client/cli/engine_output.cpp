#include "client/cli/engine_output.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>
#include <utility>

#include "client/cli/child_process.h"
#include "client/cli/exit_code.h"
#include "client/cli/staged_folder.h"
#include "client/engines/engine.h"
#include "client/engines/engine_files.h"
#include "client/engines/lit_scene.h"
#include "common/one_line.h"

namespace radiosity::cli {
namespace {

namespace fs = std::filesystem;

/// The scene as it is on the server. Its files go when they are read; the picture stays.
Result<engines::LitScene> downloadLit(const Remote& remote, const EngineRequest& request, const StagedFolder& folder,
                                      ProgressDisplay& display) {
  const auto glb = folder.stagedPath("lit.glb");
  auto names =
      saveScene(remote, {.glb_path = glb, .unlit = false, .png_path = request.png_path, .error_map = false}, display);
  if (!names) return tl::unexpected(folder.placed(names.error()));
  // The picture may be a link, and is named by what it leads to.
  const auto staging = fs::path(glb).parent_path();
  std::erase_if(*names, [&](const fs::path& name) { return name == glb || name.parent_path() != staging; });
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

/// What went wrong when Blender was to make scene.blend; empty: it did. The solve is worth keeping all the same.
/// Errors: kCancelled.
Result<std::string> makeBlend(const StagedFolder& folder, ProgressDisplay& display) {
  display.showText("making scene.blend");
  const auto ran = runProgram({"blender", "--background", "--factory-startup", "--python-exit-code", "1", "--python",
                               folder.stagedPath("make_blend.py")});
  if (!ran && ran.error().code == ErrorCode::kCancelled) return tl::unexpected(ran.error());
  if (!ran && ran.error().code == ErrorCode::kNotFound) return std::string("Blender was not found here");
  if (!ran) return ran.error().text();
  std::error_code error;
  if (ran->exit_code == 0 && fs::exists(folder.stagedPath("scene.blend"), error)) return std::string();
  const auto complaint = complaintIn(ran->text);
  return "Blender could not make scene.blend: " +
         (complaint.empty() ? fmt::format("it ended with status {}", ran->exit_code) : complaint);
}

/// As a word of a shell's command line.
std::string quoted(const std::string& text) {
  constexpr std::string_view kPlain = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_-./";
  if (!text.empty() && text.front() != '-' && text.find_first_not_of(kPlain) == std::string::npos) return text;
  std::string word = "'";
  for (const char c : text) word += c == '\'' ? "'\\''" : std::string(1, c);
  return word + "'";
}

std::vector<std::string> notesOf(const engines::Engine& engine, const engines::Exported& exported) {
  std::vector<std::string> notes = {fmt::format("{} loses {} of the light (RMS)",
                                                engines::encodingText(engine.encoding), percentText(exported.loss))};
  if (exported.baked > 0)
    notes.push_back(fmt::format("{} lamp{} taken out: {} light is in the lightmaps", exported.baked,
                                exported.baked == 1 ? "" : "s", exported.baked == 1 ? "its" : "their"));
  return notes;
}

std::string textOf(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// Whether this is a page or script that goes beside the scene, which a user may have changed, or have of his own.
bool isOfPage(std::string_view name) {
  return name.ends_with(".js") || name.ends_with(".html") || name.ends_with(".py") || name == "package.json";
}

/// Whether the folder has a file of this name that we have not written, for this engine or for another.
bool isUsers(const fs::path& path) {
  std::error_code ignored;
  if (!fs::exists(path, ignored)) return false;
  const auto text = textOf(path.string());
  const auto name = "/" + path.filename().string();
  return std::ranges::none_of(engines::allEngineFiles(),
                              [&](const auto& file) { return file.name.ends_with(name) && file.bytes == text; });
}

/// Names of the pages and scripts in the folder that are the user's own.
std::vector<std::string> usersPages(const engines::Exported& exported, const fs::path& folder) {
  std::vector<std::string> names;
  for (const auto& file : exported.files)
    if (isOfPage(file.name) && isUsers(folder / file.name)) names.push_back(file.name);
  return names;
}

/// Lightmaps that the folder has of a scene before, as its lighting.json tells.
std::vector<std::string> pagesBefore(const fs::path& folder) {
  const auto about = engines::Json::parse(textOf((folder / "lighting.json").string()), nullptr, false);
  std::vector<std::string> names;
  if (!about.is_object() || about.value("generator", engines::Json()) != "radiosity") return names;
  const auto pages = about.find("lightmaps");
  if (pages == about.end() || !pages->is_array()) return names;
  for (const auto& page : *pages) {
    const auto file = page.is_object() ? page.value("file", engines::Json()) : engines::Json();
    if (!file.is_string()) continue;
    const auto name = file.get<std::string>();
    if (name.starts_with("lightmap.") && name.find('/') == std::string::npos) names.push_back(name);
  }
  return names;
}

/// Writes the files and puts them in place.
class FolderWriter {
 public:
  FolderWriter(const engines::Engine& engine, const EngineRequest& request, StagedFolder& folder)
      : engine_(engine), request_(request), folder_(folder) {}

  Result<EngineSaved> write(const engines::Exported& exported, ProgressDisplay& display) {
    saved_.notes = notesOf(engine_, exported);
    users_ = usersPages(exported, request_.folder);
    for (const auto& file : exported.files) {
      if (auto done = folder_.write(file.name, file.bytes); !done) return tl::unexpected(done.error());
      if (users_.empty() || !isOfPage(file.name)) names_.push_back(file.name);
    }
    if (!users_.empty())
      saved_.warnings.push_back(fmt::format(
          "{} in {} {} not what --for {} writes, and stay{}: only the scene and its lightmaps were written; "
          "remove what is not yours to get ours",
          fmt::join(users_, ", "), request_.folder, users_.size() == 1 ? "is" : "are", engine_.name,
          users_.size() == 1 ? "s" : ""));
    if (auto done = tellNext(display); !done) return tl::unexpected(done.error());
    // Whoever finds it finds the files that it names.
    std::stable_partition(names_.begin(), names_.end(), [](const auto& name) { return name != "lighting.json"; });
    const auto before = pagesBefore(request_.folder);
    auto paths = folder_.commit(names_);
    if (!paths) return tl::unexpected(paths.error());
    saved_.paths = std::move(*paths);
    std::error_code ignored;
    for (const auto& name : before)
      if (std::ranges::find(names_, name) == names_.end()) fs::remove(fs::path(request_.folder) / name, ignored);
    if (!request_.png_path.empty()) saved_.paths.push_back(request_.png_path);
    return std::move(saved_);
  }

 private:
  /// What to do with the folder. Errors: as of makeBlend().
  Result<void> tellNext(ProgressDisplay& display) {
    std::string_view next = engine_.next;
    if (engine_.name == "blender") {
      const auto complaint = makeBlend(folder_, display);
      if (!complaint) return tl::unexpected(complaint.error());
      if (complaint->empty()) names_.emplace_back("scene.blend");
      if (!complaint->empty()) {
        saved_.warnings.push_back(*complaint);
        next = "blender --background --factory-startup --python make_blend.py";
      }
    } else if (!users_.empty()) {
      return {};  // their page shows it
    }
    saved_.notes.push_back(fmt::format("to see it in {}: cd {} && {}", engine_.title, quoted(request_.folder), next));
    return {};
  }

  const engines::Engine& engine_;
  const EngineRequest& request_;
  StagedFolder& folder_;
  std::vector<std::string> users_, names_;
  EngineSaved saved_;
};

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
  return FolderWriter(*engine, request, *folder).write(*exported, display);
}

void tellSaved(const EngineSaved& saved, bool quiet) {
  for (const auto& warning : saved.warnings) warn(warning);
  if (quiet) return;
  for (const auto& note : saved.notes) std::fprintf(stderr, "%s\n", oneLine(note).c_str());
}

}  // namespace radiosity::cli
