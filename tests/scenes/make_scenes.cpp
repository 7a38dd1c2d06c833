// make_scenes OUT_DIR: writes every test scene as OUT_DIR/<name>.glb.
#include <cstdio>
#include <exception>
#include <filesystem>

#include "tests/scenes/glb_writer.h"
#include "tests/scenes/scenes.h"

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fputs("usage: make_scenes OUT_DIR\nWrites the generated test scenes, one GLB each.\n", stderr);
    return 2;
  }
  try {
    const std::filesystem::path folder = argv[1];
    std::filesystem::create_directories(folder);
    for (const auto& [name, make] : radiosity::test_scenes::allScenes()) {
      const auto scene = make();
      const auto file = folder / (name + ".glb");
      radiosity::test_scenes::writeGlb(scene, file);
      std::printf("%s: %zu polygons\n", file.string().c_str(), scene.polygonCount());
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "make_scenes: %s\n", error.what());
    return 1;
  }
  return 0;
}
