#include "client/cli/scene_file.h"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>

#include "common/bytes.h"
#include "protocol/json_rpc.h"
#include "protocol/limits.h"

namespace radiosity::cli {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kGlbHeaderBytes = 12;
constexpr std::uint64_t kMaxSceneBytes = protocol::kMaxUploadBytes;

Result<Bytes> readWhole(const std::string& path, const std::string& where) {
  std::error_code error;
  if (!fs::exists(path, error)) return fail(ErrorCode::kBadInput, "no such file: " + path, where);
  if (!fs::is_regular_file(path, error)) return fail(ErrorCode::kBadInput, "not a regular file: " + path, where);
  const auto size_bytes = fs::file_size(path, error);
  if (error) return fail(ErrorCode::kBadInput, error.message(), where);
  if (size_bytes > kMaxSceneBytes)
    return fail(ErrorCode::kTooLarge, "is " + std::to_string(size_bytes) + " bytes; the limit is 1 GiB", where);
  std::ifstream file(path, std::ios::binary);
  Bytes bytes(size_bytes);
  if (!file.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size_bytes)))
    return fail(ErrorCode::kBadInput, std::string("cannot be read: ") + std::strerror(errno), where);
  return bytes;
}

std::string extensionOf(const std::string& path) {
  std::string extension = fs::path(path).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return std::tolower(c); });
  return extension;
}

std::string notGltf(const std::string& path) {
  static constexpr std::array<std::string_view, 9> kOthers = {".blend", ".fbx", ".obj", ".usd",   ".usdz",
                                                              ".dae",   ".3ds", ".ply", ".blend1"};
  const std::string extension = extensionOf(path);
  std::string text = "this is neither a GLB nor a glTF JSON file";
  if (std::find(kOthers.begin(), kOthers.end(), extension) != kOthers.end())
    text += "; export the " + extension + " as glTF 2.0 (.glb) first";
  return text;
}

std::optional<int> hexDigit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return std::nullopt;
}

std::string percentDecode(std::string_view text) {
  std::string out;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '%' && i + 2 < text.size()) {
      const auto high = hexDigit(text[i + 1]);
      const auto low = hexDigit(text[i + 2]);
      if (high && low) {
        out += static_cast<char>(*high * 16 + *low);
        i += 2;
        continue;
      }
    }
    out += text[i];
  }
  return out;
}

bool isInside(const fs::path& file, const fs::path& folder) {
  const auto relative = file.lexically_relative(folder);
  return !relative.empty() && *relative.begin() != "..";
}

bool isExternal(const nlohmann::json& entry) {
  return entry.is_object() && entry.contains("uri") && entry["uri"].is_string() &&
         !entry["uri"].get_ref<const std::string&>().starts_with("data:");
}

/// Lists of a document whose entries may lie in files of their own.
constexpr std::array kLists{"/buffers", "/images", "/extensions/EXT_lights_ies/lights"};

/// Null: there is none.
template <typename Document>
Document* listAt(Document& document, const char* list) {
  const nlohmann::json::json_pointer pointer(list);
  return document.contains(pointer) && document.at(pointer).is_array() ? &document.at(pointer) : nullptr;
}

std::string mediaType(const nlohmann::json& entry, const std::string& list, const std::string& file) {
  if (list == "/buffers") return "application/octet-stream";
  if (entry.contains("mimeType") && entry["mimeType"].is_string()) return entry["mimeType"].get<std::string>();
  const std::string extension = extensionOf(file);
  if (list != "/images") return extension == ".ldt" ? "application/x-eulumdat" : "application/x-ies-lm-63";
  if (extension == ".jpg" || extension == ".jpeg") return "image/jpeg";
  if (extension == ".webp") return "image/webp";
  if (extension == ".ktx2") return "image/ktx2";
  return "image/png";
}

Result<nlohmann::json> readGltf(const std::string& path) {
  auto bytes = readWhole(path, path);
  if (!bytes) return tl::unexpected(bytes.error());
  auto document = protocol::parseJson({reinterpret_cast<const char*>(bytes->data()), bytes->size()});
  if (!document) return fail(document.error().code, document.error().text(), path);
  if (!(*document)->is_object()) return fail(ErrorCode::kBadInput, "the file's JSON is not an object", path);
  return nlohmann::json(**document);
}

/// Replaces entry["uri"] by its file's content.
Result<void> inlineEntry(nlohmann::json& entry, const std::string& list, const fs::path& folder,
                         const std::string& where) {
  const std::string uri = entry["uri"].get<std::string>();
  if (uri.find("://") != std::string::npos)
    return fail(ErrorCode::kBadInput, "\"" + uri + "\" lies on the network; put the file beside the .gltf", where);
  std::error_code error;
  const fs::path file = fs::weakly_canonical(folder / fs::path(percentDecode(uri)), error);
  if (error || !isInside(file, folder))
    return fail(ErrorCode::kBadInput, "\"" + uri + "\" lies outside the .gltf's folder and is not sent to a server",
                where);
  auto bytes = readWhole(file.string(), where);
  if (!bytes) return tl::unexpected(bytes.error());
  entry["uri"] = "data:" + mediaType(entry, list, file.string()) + ";base64," + base64(*bytes);
  return {};
}

}  // namespace

Result<SceneKind> sceneKind(const std::string& path) {
  std::error_code error;
  if (!fs::exists(path, error)) return fail(ErrorCode::kBadInput, "no such file", path);
  if (fs::is_directory(path, error))
    return fail(ErrorCode::kBadInput, "this is a folder; name the .glb or .gltf in it", path);
  std::ifstream file(path, std::ios::binary);
  if (!file) return fail(ErrorCode::kBadInput, std::string("cannot be opened: ") + std::strerror(errno), path);
  std::array<char, 64> start{};
  file.read(start.data(), start.size());
  const std::string_view head(start.data(), static_cast<std::size_t>(file.gcount()));
  if (head.empty()) return fail(ErrorCode::kBadInput, "the file is empty", path);
  if (head.starts_with("glTF")) {
    if (head.size() < kGlbHeaderBytes) return fail(ErrorCode::kBadInput, "the GLB is cut off inside its header", path);
    return SceneKind::kGlb;
  }
  auto first =
      head.starts_with("\xEF\xBB\xBF") ? head.find_first_not_of(" \t\r\n", 3) : head.find_first_not_of(" \t\r\n");
  if (first != std::string_view::npos && head[first] == '{') return SceneKind::kGltf;
  return fail(ErrorCode::kBadInput, notGltf(path), path);
}

Result<std::vector<std::string>> externalFiles(const std::string& path) {
  const auto document = readGltf(path);
  if (!document) return tl::unexpected(document.error());
  std::vector<std::string> files;
  for (const auto* list : kLists) {
    const auto* entries = listAt(*document, list);
    if (entries == nullptr) continue;
    for (const auto& entry : *entries)
      if (isExternal(entry))
        files.push_back((fs::path(path).parent_path() / percentDecode(entry["uri"].get<std::string>())).string());
  }
  return files;
}

Result<bool> hasExternalFiles(const std::string& path) {
  return externalFiles(path).map([](const auto& files) { return !files.empty(); });
}

Result<std::string> inlineExternalFiles(const std::string& path) {
  auto document = readGltf(path);
  if (!document) return tl::unexpected(document.error());
  std::error_code error;
  const fs::path folder = fs::canonical(fs::absolute(path).parent_path(), error);
  if (error) return fail(ErrorCode::kBadInput, error.message(), path);
  std::uint64_t total_bytes = 0;
  for (const auto* list : kLists) {
    auto* found = listAt(*document, list);
    if (found == nullptr) continue;
    auto& entries = *found;
    for (std::size_t i = 0; i < entries.size(); ++i) {
      if (!isExternal(entries[i])) continue;
      const std::string where = path + ": " + list + "/" + std::to_string(i) + "/uri";
      if (auto done = inlineEntry(entries[i], list, folder, where); !done) return tl::unexpected(done.error());
      total_bytes += entries[i]["uri"].get_ref<const std::string&>().size();
      if (total_bytes > kMaxSceneBytes)
        return fail(ErrorCode::kTooLarge, "with its external files the scene is over the upload limit of 1 GiB", path);
    }
  }
  return document->dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string base64(std::span<const std::uint8_t> bytes) {
  static constexpr std::string_view kAlphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) group = group << 8U | (k < count ? bytes[i + k] : 0U);
    for (std::size_t k = 0; k < 4; ++k) out += k <= count ? kAlphabet[group >> (18U - 6U * k) & 63U] : '=';
  }
  return out;
}

}  // namespace radiosity::cli
