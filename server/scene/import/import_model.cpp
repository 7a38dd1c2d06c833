#include "server/scene/import/import_model.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "common/task.h"
#include "server/scene/import/import_record.h"

namespace radiosity::scene {
namespace {

constexpr const char* kNodes = "nodes";

/// Members of a document that are parsed together, or not at all, and what they become.
struct Part {
  std::array<const char*, 3> members;
  void (*take)(const ImportRecord& from, tinygltf::Model& to);
};
/// tinygltf looks from meshes to their accessors and views.
const std::array kParts = {
    Part{{"accessors", "bufferViews", "meshes"},
         [](const ImportRecord& from, tinygltf::Model& to) {
           to.accessors = from.model->accessors;
           to.bufferViews = from.model->bufferViews;
           to.meshes = from.model->meshes;
         }},
    Part{{kNodes}, [](const ImportRecord& from, tinygltf::Model& to) { to.nodes = from.model->nodes; }},
    Part{{"materials"}, [](const ImportRecord& from, tinygltf::Model& to) { to.materials = from.materials; }},
};
constexpr std::size_t kGeometry = 0, kNodesPart = 1, kMaterials = 2;
/// These are small.
constexpr std::array kAlways = {"asset", "cameras", "extensionsUsed", "samplers", "scene", "scenes", "textures"};

bool isSame(const Part& part, const Json& a, const Json& b) {
  return std::ranges::all_of(part.members, [&](const char* member) {
    if (member == nullptr) return true;
    const auto in_a = a.find(member), in_b = b.find(member);
    return in_a == a.end() || in_b == b.end() ? (in_a == a.end()) == (in_b == b.end()) : *in_a == *in_b;
  });
}

void addMember(const Json& gltf, const char* member, Json& out) {
  const auto found = gltf.find(member);
  if (found == gltf.end()) return;
  auto& copy = out[member] = *found;
  if (!copy.is_array()) return;
  for (auto& entry : copy) {
    if (!entry.is_object()) continue;
    entry.erase("extras");
    entry.erase("extensions");
  }
}

/// The part of the JSON that tinygltf is to see: `parts` without nodes, and what is always parsed. It copies extras and
/// extensions into values of its own; ours are read from Document::gltf, so they need not go there, except lights.
Json reduced(const Json& gltf, std::span<const Part* const> parts) {
  Json out = Json::object();
  for (const auto* member : kAlways) addMember(gltf, member, out);
  for (const auto* part : parts) {
    for (const auto* member : part->members)
      if (member != nullptr && member != kNodes) addMember(gltf, member, out);
  }
  const auto extensions = gltf.value("extensions", Json::object());
  if (extensions.contains("KHR_lights_punctual")) {
    out["extensions"]["KHR_lights_punctual"] = extensions["KHR_lights_punctual"];
  }
  return out;
}

/// See parseModel: gives index accessors without a view the index of the extra one.
void addZeroView(Json& gltf) {
  auto& views = gltf["bufferViews"];
  if (views.is_null()) views = Json::array();
  const auto zero_view = views.size();
  views.push_back({{"buffer", 0}, {"byteLength", 1}});
  if (!gltf.contains("meshes")) return;
  for (const auto& mesh : gltf["meshes"]) {
    for (const auto& primitive : mesh["primitives"]) {
      if (!primitive.contains("indices")) continue;
      auto& accessor = gltf["accessors"][primitive["indices"].get<std::size_t>()];
      if (!accessor.contains("bufferView")) accessor["bufferView"] = zero_view;
    }
  }
}

/// How many entries the lists of a model have, and how many primitives each of its meshes.
struct Shape {
  std::array<std::size_t, 9> lists{};
  std::vector<std::size_t> primitives;

  bool operator==(const Shape&) const = default;
};

Shape shapeOf(const Json& gltf) {
  const auto size = [&](const char* list) { return gltf.contains(list) ? gltf[list].size() : 0; };
  Shape shape{{size("nodes"), size("meshes"), size("materials"), size("accessors"), size("textures"), size("cameras"),
               size("bufferViews"), size("samplers"), size("scenes")},
              {}};
  if (!gltf.contains("meshes")) return shape;
  for (const auto& mesh : gltf["meshes"]) shape.primitives.push_back(mesh["primitives"].size());
  return shape;
}

Shape shapeOf(const tinygltf::Model& model) {
  Shape shape{
      {model.nodes.size(), model.meshes.size(), model.materials.size(), model.accessors.size(), model.textures.size(),
       model.cameras.size(), model.bufferViews.size(), model.samplers.size(), model.scenes.size()},
      {}};
  for (const auto& mesh : model.meshes) shape.primitives.push_back(mesh.primitives.size());
  return shape;
}

/// Nothing may be opened: everything that tinygltf needs is in the text.
tinygltf::FsCallbacks closedFileSystem() {
  tinygltf::FsCallbacks fs{};
  fs.FileExists = [](const std::string&, void*) { return false; };
  fs.ExpandFilePath = [](const std::string&, void*) { return std::string(); };
  fs.ReadWholeFile = [](std::vector<unsigned char>*, std::string*, const std::string&, void*) { return false; };
  fs.WriteWholeFile = [](std::string*, const std::string&, const std::vector<unsigned char>&, void*) { return false; };
  return fs;
}

bool refuseImage(tinygltf::Image*, int, std::string*, std::string*, int, int, const unsigned char*, int, void*) {
  return false;
}

/// All of these are what the schema says, or are not there.
int indexAt(const Json& node, const char* member) {
  const auto found = node.find(member);
  return found == node.end() ? -1 : static_cast<int>(found->get<std::int64_t>());
}

template <typename Number>
std::vector<Number> numbersAt(const Json& node, const char* member) {
  std::vector<Number> numbers;
  const auto found = node.find(member);
  if (found == node.end()) return numbers;
  numbers.reserve(found->size());
  for (const auto& number : *found) numbers.push_back(number.get<Number>());
  return numbers;
}

tinygltf::Node nodeOf(const Json& json) {
  tinygltf::Node node;
  if (const auto name = json.find("name"); name != json.end()) node.name = name->get_ref<const std::string&>();
  node.skin = indexAt(json, "skin");
  node.camera = indexAt(json, "camera");
  node.mesh = indexAt(json, "mesh");
  node.matrix = numbersAt<double>(json, "matrix");
  if (node.matrix.empty()) {
    node.rotation = numbersAt<double>(json, "rotation");
    node.scale = numbersAt<double>(json, "scale");
    node.translation = numbersAt<double>(json, "translation");
  }
  node.children = numbersAt<int>(json, "children");
  node.weights = numbersAt<double>(json, "weights");
  return node;
}

/// As tinygltf would read them. There may be hundreds of thousands: to write them as text for it, and to have that
/// parsed, takes ten times as long.
std::vector<tinygltf::Node> nodesOf(const Json& gltf) {
  std::vector<tinygltf::Node> nodes;
  const auto found = gltf.find(kNodes);
  if (found == gltf.end()) return nodes;
  nodes.reserve(found->size());
  for (const auto& node : *found) {
    interruptionPoint();
    nodes.push_back(nodeOf(node));
  }
  return nodes;
}

Result<tinygltf::Model> parse(const Document& document, std::span<const Part* const> parsed) {
  auto json = reduced(document.gltf, parsed);
  if (std::ranges::find(parsed, &kParts[kGeometry]) != parsed.end()) addZeroView(json);
  const auto shape = shapeOf(json);
  const auto text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  if (text.size() > std::numeric_limits<unsigned>::max()) {
    return fail(ErrorCode::kTooLarge, "JSON has more than 4 GiB", document.name);
  }
  json = nullptr;  // of a million nodes it takes a gigabyte, and the parser makes another of its own
  tinygltf::TinyGLTF loader;
  loader.SetFsCallbacks(closedFileSystem());
  loader.SetImageLoader(refuseImage, nullptr);
  tinygltf::Model model;
  std::string error;
  std::string warning;
  const bool ok =
      loader.LoadASCIIFromString(&model, &error, &warning, text.c_str(), static_cast<unsigned>(text.size()), "");
  if (!ok || shapeOf(model) != shape) {
    return fail(ErrorCode::kInvalidScene, "tinygltf cannot read it: " + error, place(document.name, "/"));
  }
  return model;
}

}  // namespace

Result<tinygltf::Model> parseModel(const Document& document, const Json* former, const ImportRecord* before) {
  std::vector<const Part*> parsed, taken;
  for (const auto& part : kParts)
    (before != nullptr && isSame(part, document.gltf, *former) ? taken : parsed).push_back(&part);
  auto model = parse(document, parsed);
  if (!model) return model;
  if (std::ranges::find(parsed, &kParts[kNodesPart]) != parsed.end()) model->nodes = nodesOf(document.gltf);
  for (const auto* part : taken) part->take(*before, *model);
  return model;
}

Result<std::vector<tinygltf::Material>> parseMaterials(const Document& document) {
  const std::array parts{&kParts[kMaterials]};
  auto model = parse(document, parts);
  if (!model) return tl::unexpected(model.error());
  return std::move(model->materials);
}

const tinygltf::BufferView* viewOf(const tinygltf::Model& model, int view) {
  if (view < 0 || static_cast<std::size_t>(view) + 1 >= model.bufferViews.size()) return nullptr;
  return &model.bufferViews[static_cast<std::size_t>(view)];
}

}  // namespace radiosity::scene
