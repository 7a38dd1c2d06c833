// What becomes of a document: refused, with an answer, or read again as it was saved. For tests.
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

/// Written as a GLB and read again it is what it was.
inline void expectSavedAndReadAsItIs(const Document& document) {
  const auto again = parseDocument("again.glb", *writeGlb(document));
  ASSERT_TRUE(again) << again.error().text();
  EXPECT_EQ(again->gltf["meshes"], document.gltf["meshes"]);
  EXPECT_EQ(again->gltf["accessors"], document.gltf["accessors"]);
  EXPECT_EQ(again->gltf["bufferViews"], document.gltf["bufferViews"]);
  ASSERT_EQ(again->buffers.size(), document.buffers.size());
  for (std::size_t i = 0; i < document.buffers.size(); ++i) EXPECT_EQ(*again->buffers[i], *document.buffers[i]);
}

}  // namespace radiosity::scene::test
