// The scene that a document is, for tests.
#pragma once

#include <gtest/gtest.h>

#include <utility>

#include "tests/unit/scene/gltf_builder.h"

namespace radiosity::scene::test {

/// Fails the test where it is refused.
inline Scene imported(const GltfBuilder& builder) {
  auto scene = builder.scene();
  EXPECT_TRUE(scene) << scene.error().text();
  return scene ? std::move(*scene) : Scene{};
}

}  // namespace radiosity::scene::test
