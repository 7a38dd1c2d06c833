// What a document that cannot be read is answered, for tests.
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "tests/unit/scene/gltf_builder.h"

namespace radiosity::scene::test {

/// `where`: a JSON pointer; `what`: part of the message.
inline void expectRefused(const GltfBuilder& builder, ErrorCode code, const std::string& where, const std::string& what,
                          const ImportLimits& limits = {}) {
  const auto scene = builder.scene(limits);
  ASSERT_FALSE(scene) << what;
  EXPECT_EQ(scene.error().code, code) << scene.error().text();
  EXPECT_EQ(scene.error().where, "test.glb: " + where) << scene.error().text();
  EXPECT_THAT(scene.error().message, testing::HasSubstr(what));
}

}  // namespace radiosity::scene::test
