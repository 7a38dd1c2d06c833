// The webs of lights as viewers draw them: few directions, no beam lost, in the space of the lamp.
#include "server/scene/import/light_web_of.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>

#include "tests/unit/scene/gltf_builder.h"

namespace radiosity::scene {
namespace {

using test::GltfBuilder;
using testing::ElementsAre;
using Json = nlohmann::json;

std::string encoded(const std::string& text) {
  std::string uri = "data:application/x-ies-lm-63,";
  for (const char c : text) uri += c == '\n' ? "%0A" : c == ' ' ? "%20" : c == '=' ? "%3D" : std::string(1, c);
  return uri;
}

Document withFile(const std::string& file) {
  GltfBuilder builder;
  builder.gltf["extensionsUsed"] = {"EXT_lights_ies"};
  builder.gltf["extensions"]["EXT_lights_ies"]["lights"] = Json::array({{{"uri", encoded(file)}}});
  builder.node({{"extensions", {{"EXT_lights_ies", {{"light", 0}}}}}});
  auto document = builder.document();
  EXPECT_TRUE(document) << document.error().text();
  return document ? std::move(*document) : Document{};
}

std::string head(std::size_t vertical, std::size_t horizontal, int type) {
  std::ostringstream out;
  out << "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 " << vertical << " " << horizontal << " " << type << " 2 0 0 0 1 1 10\n";
  return out.str();
}

TEST(LightWebOf, tellsASmallWebAsItIs) {
  const auto web = lightWebOf(withFile(head(3, 1, 1) + "0 45 90\n0\n100 60 0\n"), 0);
  ASSERT_TRUE(web) << web.error().text();
  EXPECT_THAT(web->polar, ElementsAre(0, 45, 90));
  EXPECT_THAT(web->azimuth, ElementsAre(0));
  EXPECT_THAT(web->candela, ElementsAre(100, 60, 0));
  EXPECT_EQ(web->most_candela, 100.0);
  EXPECT_EQ(web->axis, glm::dvec3(0, 0, -1));
  EXPECT_EQ(web->across, glm::dvec3(1, 0, 0));
}

TEST(LightWebOf, hasTheAxesOfItsType) {
  const auto web = lightWebOf(withFile(head(3, 3, 2) + "-90 0 90\n-90 0 90\n1 1 1 1 9 1 1 1 1\n"), 0);
  ASSERT_TRUE(web) << web.error().text();
  EXPECT_EQ(web->axis, glm::dvec3(0, -1, 0)) << "the polar axis of type B is horizontal";
  EXPECT_EQ(web->across, glm::dvec3(0, 0, -1));
}

TEST(LightWebOf, keepsBeamsOfWebsThatAreTooFineToDraw) {
  std::ostringstream fine;
  fine << head(1801, 1, 1);
  for (int i = 0; i <= 1800; ++i) fine << 0.1 * i << "\n";
  fine << "0\n";
  for (int i = 0; i <= 1800; ++i) fine << (i == 333 ? 5000 : 1) << "\n";
  const auto web = lightWebOf(withFile(fine.str()), 0);
  ASSERT_TRUE(web) << web.error().text();
  EXPECT_EQ(web->polar.size(), kMostShownPolar);
  EXPECT_EQ(web->polar.front(), 0.0F);
  EXPECT_EQ(web->polar.back(), 180.0F);
  EXPECT_EQ(std::ranges::count(web->candela, 5000.0F), 1) << "a beam of a tenth of a degree";
}

TEST(LightWebOf, goesByTheBufferViewAsTheImportDoes) {
  auto document = withFile(head(2, 1, 1) + "0 90\n0\n7 7\n");
  auto& light = document.gltf["extensions"]["EXT_lights_ies"]["lights"][0];
  ASSERT_TRUE(light.contains("bufferView"));
  light["uri"] = encoded(head(2, 1, 1) + "0 90\n0\n1 1\n");
  const auto web = lightWebOf(document, 0);
  const auto scene = importScene(document);
  ASSERT_TRUE(web) << web.error().text();
  ASSERT_TRUE(scene) << scene.error().text();
  EXPECT_EQ(web->most_candela, 7.0);
  EXPECT_EQ(scene->lights.at(0).web->candela()[0], 7.0F);
}

TEST(LightWebOf, namesWhatIsNotThere) {
  const auto document = withFile(head(2, 1, 1) + "0 90\n0\n1 1\n");
  const auto web = lightWebOf(document, 1);
  ASSERT_FALSE(web);
  EXPECT_EQ(web.error().code, ErrorCode::kNotFound);
  EXPECT_FALSE(lightWebOf(Document{}, 0));
}

}  // namespace
}  // namespace radiosity::scene
