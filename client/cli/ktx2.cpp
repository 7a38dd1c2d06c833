#include "client/cli/ktx2.h"

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>
#include <vector>

#include "client/cli/child_process.h"
#include "client/cli/scene_file.h"
#include "client/cli/transcoder_files.h"

namespace radiosity::cli {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr std::string_view kExtension = "KHR_texture_basisu";

struct Folder {
  explicit Folder(std::string name) : path(std::move(name)) {}
  Folder(const Folder&) = delete;
  Folder& operator=(const Folder&) = delete;
  fs::path path;
  ~Folder() {
    std::error_code ignored;
    fs::remove_all(path, ignored);
  }
};

Result<std::shared_ptr<const Folder>> makeFolder() {
  std::error_code error;
  auto name = (fs::temp_directory_path(error) / "radiosity-ktx2-XXXXXX").string();
  if (error || mkdtemp(name.data()) == nullptr)
    return fail(ErrorCode::kUnavailable, std::string("cannot be made: ") + std::strerror(errno), name);
  return std::make_shared<const Folder>(std::move(name));
}

Result<void> write(const fs::path& path, std::string_view bytes) {
  std::ofstream file(path, std::ios::binary);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (file) return {};
  return fail(ErrorCode::kUnavailable, std::string("cannot be written: ") + std::strerror(errno), path.string());
}

/// Whether a texture has no picture but one of KTX2. What is no sound glTF needs none: whoever reads it says why.
bool needsPictures(const Json& gltf) {
  const auto member = [](const Json& of, std::string_view name) -> const Json& {
    static const Json kNone;
    if (!of.is_object()) return kNone;
    const auto found = of.find(name);
    return found == of.end() ? kNone : *found;
  };
  const auto& images = member(gltf, "images");
  for (const auto& texture : member(gltf, "textures")) {
    if (member(member(texture, "extensions"), kExtension).is_null()) continue;
    const auto& source = member(texture, "source");
    const bool is_there = source.is_number_unsigned() && source.get<std::uint64_t>() < images.size();
    if (!is_there || member(images[source.get<std::size_t>()], "mimeType") == "image/ktx2") return true;
  }
  return false;
}

/// What the script says of its input is of the user's file.
Result<void> transcode(const fs::path& folder, const std::string& from, const std::string& to,
                       const std::string& path) {
  const auto files = transcoderFiles();
  if (files.script.empty())
    return fail(ErrorCode::kUnsupported,
                "has KTX2 textures, and this program was built without the npm packages that unpack them; export PNG, "
                "JPEG or WebP",
                path);
  const auto script = folder / "transcode.mjs", basis = folder / "basis.js", wasm = folder / "basis.wasm";
  for (const auto& [file, bytes] :
       {std::pair(script, files.script), std::pair(basis, files.basis_script), std::pair(wasm, files.basis_wasm)})
    if (auto written = write(file, bytes); !written) return written;
  const auto ran = runProgram({"node", script.string(), basis.string(), wasm.string(), from, to});
  if (!ran && ran.error().code == ErrorCode::kNotFound)
    return fail(ErrorCode::kUnsupported,
                "has KTX2 textures, which node unpacks, and node was not found: install it (Debian: nodejs), drop the "
                "file on the viewer, or export PNG, JPEG or WebP",
                path);
  if (!ran) return tl::unexpected(ran.error());
  if (ran->exit_code != 0) return fail(ErrorCode::kBadInput, ran->text.empty() ? "node failed" : ran->text, path);
  return {};
}

}  // namespace

bool needsKtx2(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::array<char, 20> head{};
  file.read(head.data(), head.size());
  std::string text(head.data(), static_cast<std::size_t>(file.gcount()));
  if (text.starts_with("glTF")) {  // only of the JSON, which comes first
    if (text.size() < head.size()) return false;
    std::uint32_t bytes = 0;
    std::memcpy(&bytes, head.data() + 12, sizeof bytes);
    std::error_code error;
    const auto size = fs::file_size(path, error);
    if (error || bytes > size) return false;
    text.resize(bytes);
    file.read(text.data(), bytes);
  } else {
    text.append(std::istreambuf_iterator<char>(file), {});
  }
  return text.find(kExtension) != std::string::npos && needsPictures(Json::parse(text, nullptr, false));
}

Result<SceneToSend> withoutKtx2(const std::string& path) {
  SceneToSend scene(path);
  if (!needsKtx2(path)) return scene;
  const auto kind = sceneKind(path);
  if (!kind) return tl::unexpected(kind.error());
  const auto folder = makeFolder();
  if (!folder) return tl::unexpected(folder.error());
  auto from = path;
  if (*kind == SceneKind::kGltf) {
    const auto text = inlineExternalFiles(path);
    if (!text) return tl::unexpected(text.error());
    from = ((*folder)->path / "scene.gltf").string();
    if (auto written = write(from, *text); !written) return tl::unexpected(written.error());
  }
  const auto to = (*folder)->path / (*kind == SceneKind::kGlb ? "sent.glb" : "sent.gltf");
  if (auto done = transcode((*folder)->path, from, to.string(), path); !done) return tl::unexpected(done.error());
  scene.path_ = to.string();
  scene.folder_ = *folder;
  return scene;
}

}  // namespace radiosity::cli
