#include "client/cli/model_merge.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <set>
#include <utility>

#include "client/cli/scene_edits.h"
#include "protocol/json_rpc.h"

namespace radiosity::cli {
namespace {

/// Each has a list of lights at the root, which nodes name by number.
constexpr std::array kLightsExtensions{"KHR_lights_punctual", "EXT_lights_area", "EXT_lights_ies"};

Json::json_pointer lightsOf(const std::string& extension) {
  return Json::json_pointer("/extensions/" + extension + "/lights");
}

std::uint32_t wordAt(std::string_view bytes, std::size_t at) {
  std::uint32_t word = 0;
  for (std::size_t i = 0; i < 4; ++i)
    word |= static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[at + i])) << (8U * i);
  return word;
}

/// Moves every index of an object along by what the scene has already.
class Renumber {
 public:
  explicit Renumber(const Json& scene) {
    for (const char* array : {"accessors", "buffers", "bufferViews", "cameras", "images", "materials", "meshes",
                              "nodes", "samplers", "textures"})
      first_[array] = scene.contains(array) && scene[array].is_array() ? scene[array].size() : 0;
    for (const auto* name : kLightsExtensions)
      first_[name] = scene.contains(lightsOf(name)) ? scene.at(lightsOf(name)).size() : 0;
  }

  [[nodiscard]] std::size_t first(const std::string& array) const { return first_.at(array); }

  void bufferView(Json& view) const {
    move(view, "buffer", "buffers");
    for (const auto* name : {"EXT_meshopt_compression", "KHR_meshopt_compression"})
      if (auto* compressed = extensionOf(view, name)) move(*compressed, "buffer", "buffers");
  }
  void accessor(Json& accessor) const {
    move(accessor, "bufferView", "bufferViews");
    if (!accessor.contains("sparse")) return;
    move(accessor["sparse"]["indices"], "bufferView", "bufferViews");
    move(accessor["sparse"]["values"], "bufferView", "bufferViews");
  }
  void image(Json& image) const { move(image, "bufferView", "bufferViews"); }
  void light(Json& light) const { move(light, "bufferView", "bufferViews"); }
  void texture(Json& texture) const {
    move(texture, "source", "images");
    move(texture, "sampler", "samplers");
    if (auto* webp = extensionOf(texture, "EXT_texture_webp")) move(*webp, "source", "images");
  }
  /// Textures are named by objects whose member ends in "Texture", in the material and in its extensions.
  void material(Json& value) const {
    if (!value.is_object()) return;
    for (auto& [key, child] : value.items()) {
      if (key.ends_with("Texture")) move(child, "index", "textures");
      if (key != "extras") material(child);
    }
  }
  void mesh(Json& mesh) const {
    for (auto& primitive : mesh["primitives"]) {
      moveAll(primitive["attributes"], "accessors");
      move(primitive, "indices", "accessors");
      move(primitive, "material", "materials");
      if (primitive.contains("targets"))
        for (auto& target : primitive["targets"]) moveAll(target, "accessors");
      if (auto* draco = extensionOf(primitive, "KHR_draco_mesh_compression")) move(*draco, "bufferView", "bufferViews");
    }
  }
  void node(Json& node) const {
    node.erase("skin");
    move(node, "mesh", "meshes");
    move(node, "camera", "cameras");
    if (node.contains("children")) moveAll(node["children"], "nodes");
    if (!node.contains("extensions")) return;
    auto& extensions = node["extensions"];
    for (const auto* name : kLightsExtensions)
      if (extensions.contains(name)) move(extensions[name], "light", name);
    if (extensions.contains("EXT_mesh_gpu_instancing"))
      moveAll(extensions["EXT_mesh_gpu_instancing"]["attributes"], "accessors");
  }

 private:
  /// Null: there is none.
  static Json* extensionOf(Json& object, const char* name) {
    const bool there = object.is_object() && object.contains("extensions") && object["extensions"].contains(name);
    return there ? &object["extensions"][name] : nullptr;
  }
  void shift(Json& index, const std::string& array) const {
    if (index.is_number_unsigned()) index = index.get<std::size_t>() + first_.at(array);
  }
  void move(Json& object, const char* member, const std::string& array) const {
    if (object.is_object() && object.contains(member)) shift(object[member], array);
  }
  void moveAll(Json& list, const std::string& array) const {
    for (auto& index : list) shift(index, array);
  }

  std::map<std::string, std::size_t> first_;
};

class Merger {
 public:
  Merger(const Json& scene, const Json& model, const std::string& bin_uri)
      : scene_(scene), model_(model), bin_uri_(bin_uri), renumber_(scene) {}

  Result<Merge> run(const Placement& placement) {
    bool is_first = true;  // of a GLB only that can be its binary chunk; others without a URI have no data
    append("buffers", [&](Json& buffer) {
      if (std::exchange(is_first, false) && !buffer.contains("uri")) buffer["uri"] = bin_uri_;
    });
    append("bufferViews", [&](Json& view) { renumber_.bufferView(view); });
    append("accessors", [&](Json& accessor) { renumber_.accessor(accessor); });
    append("images", [&](Json& image) { renumber_.image(image); });
    append("samplers", [](Json&) {});
    append("textures", [&](Json& texture) { renumber_.texture(texture); });
    append("materials", [&](Json& material) { renumber_.material(material); });
    append("meshes", [&](Json& mesh) { renumber_.mesh(mesh); });
    append("cameras", [](Json&) {});
    lights();
    append("nodes", [&](Json& node) { renumber_.node(node); });
    extensions();
    return place(placement);
  }

 private:
  template <typename Change>
  void append(const std::string& array, const Change& change) {
    if (!model_.contains(array) || model_[array].empty()) return;
    Json entries = model_[array];
    for (auto& entry : entries) change(entry);
    appendList("/" + array, scene_.contains(array), std::move(entries));
  }

  void appendList(const std::string& pointer, bool there, Json entries) {
    if (!there) return add(pointer, std::move(entries));
    for (auto& entry : entries) add(pointer + "/-", std::move(entry));
  }

  void add(const std::string& path, Json value) {
    patch_.push_back({{"op", "add"}, {"path", path}, {"value", std::move(value)}});
  }

  void lights() {
    bool there = scene_.contains("extensions");
    for (const std::string name : kLightsExtensions) {
      if (!model_.contains(lightsOf(name))) continue;
      Json lights = model_.at(lightsOf(name));
      for (auto& light : lights) renumber_.light(light);
      if (scene_.contains(lightsOf(name))) {
        appendList(lightsOf(name).to_string(), true, std::move(lights));
        continue;
      }
      if (!std::exchange(there, true)) add("/extensions", Json::object());
      add("/extensions/" + name, {{"lights", std::move(lights)}});
    }
  }

  void extensions() {
    for (const char* list : {"extensionsUsed", "extensionsRequired"}) {
      Json fresh = Json::array();
      const auto known = scene_.value(list, Json::array());
      for (const auto& name : model_.value(list, Json::array()))
        if (std::find(known.begin(), known.end(), name) == known.end()) fresh.push_back(name);
      if (!fresh.empty()) appendList(std::string("/") + list, scene_.contains(list), std::move(fresh));
    }
  }

  /// Nodes of the model's scene, or all that have no parent.
  [[nodiscard]] std::vector<std::size_t> roots() const {
    const auto scenes = model_.value("scenes", Json::array());
    const auto shown = model_.value("scene", std::size_t{0});
    if (shown < scenes.size()) return scenes[shown].value("nodes", std::vector<std::size_t>());
    const auto nodes = model_.value("nodes", Json::array());
    std::set<std::size_t> found;
    for (std::size_t n = 0; n < nodes.size(); ++n) found.insert(n);
    for (const auto& node : nodes)
      for (const auto& child : node.value("children", std::vector<std::size_t>())) found.erase(child);
    return {found.begin(), found.end()};
  }

  /// "table", or "table 2" where that is taken.
  [[nodiscard]] std::string freeName(const std::string& wanted) const {
    std::set<std::string> taken;
    for (const auto* gltf : {&scene_, &model_})
      for (const auto& node : gltf->value("nodes", Json::array())) taken.insert(node.value("name", std::string()));
    auto name = wanted;
    for (int i = 2; taken.contains(name); ++i) name = fmt::format("{} {}", wanted, i);
    return name;
  }

  Result<Merge> place(const Placement& placement) {
    const auto children = roots();
    if (children.empty()) return fail(ErrorCode::kBadInput, "the file shows no node");
    const auto name = freeName(placement.name);
    Json node = {{"name", name}, {"translation", placement.translation}};
    for (const auto child : children) node["children"].push_back(child + renumber_.first("nodes"));
    const auto index = renumber_.first("nodes") + model_["nodes"].size();
    add("/nodes/-", std::move(node));
    if (auto done = attach(placement, index); !done) return tl::unexpected(done.error());
    return Merge{std::move(patch_), "@" + name};
  }

  Result<void> attach(const Placement& placement, std::size_t index) {
    if (placement.parent) {
      const auto parent = findNode(scene_, *placement.parent);
      if (!parent) return tl::unexpected(parent.error());
      attachTo("/nodes/" + std::to_string(*parent) + "/children", scene_["nodes"][*parent].contains("children"), index);
      return {};
    }
    const auto scenes = scene_.value("scenes", Json::array());
    const auto shown = scene_.value("scene", std::size_t{0});
    if (shown >= scenes.size()) {
      add("/scenes", Json::array({{{"nodes", {index}}}}));
    } else {
      attachTo(fmt::format("/scenes/{}/nodes", shown), scenes[shown].contains("nodes"), index);
    }
    return {};
  }

  void attachTo(const std::string& list, bool there, std::size_t index) {
    if (there) return add(list + "/-", index);
    add(list, Json::array({index}));
  }

  const Json &scene_, &model_;
  const std::string& bin_uri_;
  Renumber renumber_;
  Json patch_ = Json::array();
};

/// A GLB for `add` goes whole: what lies in other files would be asked of the server, which has no such upload.
Result<void> expectAllInside(const Json& gltf, const std::string& name) {
  for (const std::string list : {"/buffers", "/images", "/extensions/EXT_lights_ies/lights"}) {
    const Json::json_pointer pointer(list);
    if (!gltf.contains(pointer) || !gltf.at(pointer).is_array()) continue;
    const auto& entries = gltf.at(pointer);
    for (std::size_t i = 0; i < entries.size(); ++i) {
      const auto& entry = entries[i];
      const auto uri = entry.is_object() ? entry.value("uri", Json()) : Json();
      if (!uri.is_string() || uri.get_ref<const std::string&>().starts_with("data:")) continue;
      return fail(ErrorCode::kBadInput, uri.dump() + " is another file; pack it into the .glb, or add a .gltf",
                  fmt::format("{}: {}/{}/uri", name, list, i));
    }
  }
  return {};
}

}  // namespace

Result<Model> splitModel(std::string_view glb, const std::string& name) {
  constexpr std::uint32_t kJson = 0x4E4F534A, kBin = 0x004E4942;
  constexpr std::size_t kHeader = 12, kChunkHeader = 8;
  if (glb.size() < kHeader + kChunkHeader || !glb.starts_with("glTF") || wordAt(glb, 4) != 2)
    return fail(ErrorCode::kBadInput, "is no GLB of glTF 2.0", name);
  Model model;
  for (std::size_t at = kHeader; at + kChunkHeader <= glb.size();) {
    const std::size_t length = wordAt(glb, at);
    const auto type = wordAt(glb, at + 4);
    at += kChunkHeader;
    if (length > glb.size() - at) return fail(ErrorCode::kBadInput, "the GLB is cut off", name);
    if (type == kJson) {
      const auto padded = glb.substr(at, length);  // by some exporters with zeros
      const auto json = protocol::parseJson(padded.substr(0, padded.find_last_not_of('\0') + 1));
      if (!json) return fail(json.error().code, "the GLB's JSON: " + json.error().text(), name);
      model.gltf = **json;
    }
    if (type == kBin) model.bin = glb.substr(at, length);
    at += length;
  }
  if (!model.gltf.is_object()) return fail(ErrorCode::kBadInput, "the GLB has no JSON that can be read", name);
  if (const auto inside = expectAllInside(model.gltf, name); !inside) return tl::unexpected(inside.error());
  return model;
}

Result<Merge> mergeModel(const Json& scene, const Json& model, const std::string& bin_uri, const Placement& placement) {
  // The file may be wrong in any way; the library says so by exceptions, which go no further.
  try {
    return Merger(scene, model, bin_uri).run(placement);
  } catch (const Json::exception& e) {
    return fail(ErrorCode::kBadInput, std::string("is not the glTF that it seems to be: ") + e.what());
  }
}

}  // namespace radiosity::cli
