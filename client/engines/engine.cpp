#include "client/engines/engine.h"

#include <algorithm>

namespace radiosity::engines {

const std::vector<Engine>& allEngines() {
  constexpr std::string_view kServe = "npm install && npm start";
  static const std::vector<Engine> kEngines = {
      {"three", "three.js", Encoding::kHalfExr, kServe},
      {"babylon", "Babylon.js", Encoding::kPlainHalfExr, kServe},
      {"playcanvas", "PlayCanvas", Encoding::kHalfDds, kServe},
      {"blender", "Blender", Encoding::kHalfExr, "blender scene.blend"},
  };
  return kEngines;
}

const Engine* findEngine(std::string_view name) {
  const auto& all = allEngines();
  const auto found = std::ranges::find(all, name, &Engine::name);
  return found == all.end() ? nullptr : &*found;
}

std::vector<std::string> engineNames() {
  std::vector<std::string> names;
  for (const auto& engine : allEngines()) names.emplace_back(engine.name);
  return names;
}

std::string_view encodingText(Encoding encoding) {
  switch (encoding) {
    case Encoding::kHalfExr:
    case Encoding::kPlainHalfExr:
      return "half-float EXR";
    case Encoding::kHalfDds:
      return "half-float DDS";
  }
  return "";
}

}  // namespace radiosity::engines
