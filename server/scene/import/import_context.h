// What the parts of the importer share while one document is read. Lives for one importScene call, on its thread.
#pragma once

#include <map>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "server/scene/document/document.h"
#include "server/scene/document/json_text.h"
#include "server/scene/import/import_model.h"
#include "server/scene/import/import_record.h"
#include "server/scene/values/scene.h"

namespace radiosity::scene {

struct ImportContext {
  const Document& document;
  const ImportLimits& limits;
  const tinygltf::Model& model;  ///< but for its materials
  const std::vector<tinygltf::Material>& materials;
  const ImportRecord* before;  ///< of the document before an edit; null: none, or not known
  DecodedImages& images;       ///< gets those that are used
  Scene& scene;
  ReadWebs& webs;                        ///< gets those that are used
  ReadSkies& skies;                      ///< gets those that are used
  std::uint64_t claimed_bytes = 0;       ///< of memory, by all but images (scene_memory.h)
  std::set<std::string> webs_told = {};  ///< pointers of the lights whose warnings were told
  /// By index of EXT_lights_ies, those that were met.
  std::map<std::size_t, std::shared_ptr<const ReadWeb>> webs_of_lights = {};
  std::uint64_t web_bytes = 0;  ///< of their tables, and of the sky

  void warn(std::string_view pointer, std::string_view what) {
    scene.warnings.push_back(place(document.name, pointer) + ": " + std::string(what));
  }
  [[nodiscard]] tl::unexpected<Error> bad(std::string_view pointer, std::string what) const {
    return fail(ErrorCode::kInvalidScene, std::move(what), place(document.name, pointer));
  }
  [[nodiscard]] tl::unexpected<Error> tooLarge(std::string_view pointer, std::string what) const {
    return fail(ErrorCode::kTooLarge, std::move(what), place(document.name, pointer));
  }
};

}  // namespace radiosity::scene
