// Pictures: radiance of a textured, emitting, lit square, half-texel exact lightmap look-ups, back faces, the sky.
#include "server/gpu/picture/view_renderer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>
#include <numbers>

#include "common/task.h"
#include "server/gpu/picture/view_sky.h"

namespace radiosity::gpu {
namespace {

constexpr float kPi = std::numbers::pi_v<float>;

/// A unit square at z = 0 facing +z, seen squarely from z = 1, filling the picture. Page of 4 x 4 texels.
struct SquareScene {
  scene::Scene scene;
  scene::PatchScene patches;
  std::vector<Image> pages;
  ViewRequest request;

  SquareScene() {
    scene::Material material;
    material.base_color = {0.5F, 0.25F, 1.0F};
    material.emission = {0.0F, 2.0F, 0.0F};
    material.metallic = 0.5F;
    scene.materials = {material};
    scene::Primitive primitive;
    primitive.positions = {{-0.5, -0.5, 0}, {0.5, -0.5, 0}, {0.5, 0.5, 0}, {-0.5, 0.5, 0}};
    primitive.texcoord0 = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
    primitive.indices = {0, 1, 2, 0, 2, 3};
    scene.primitives = {primitive};
    scene::Instance instance;
    instance.primitive = 0;
    scene.instances = {instance};
    scene::PatchScene::SideUv uvs;
    uvs.corners = {{glm::vec2(0, 0), {1, 0}, {1, 1}}, {glm::vec2(0, 0), {1, 1}, {0, 1}}};
    uvs.page = {0, 0};
    patches.instance_uvs = {{{uvs, {}}}};
    patches.pages = {{4, 4}};
    pages = {Image(4, 4, glm::vec3(kPi))};
    request.camera.yfov_rad = 2.0 * std::atan(0.5);
    request.camera.world = glm::translate(glm::dmat4(1.0), glm::dvec3(0, 0, 1));
    request.width = request.height = 32;
  }
};

class View : public ::testing::Test {
 protected:
  void SetUp() override {
    auto made = makeViewRenderer();
    if (!made) GTEST_SKIP() << made.error().text();
    renderer_ = std::move(*made);
  }
  ViewPicture render(const SquareScene& square) {
    auto picture = renderer_->render(square.scene, square.patches, square.pages, square.request);
    EXPECT_TRUE(picture.has_value()) << picture.error().text();
    return picture ? *picture : ViewPicture{Image(1, 1), {0.0F}};
  }
  Image picture(const SquareScene& square) { return render(square).image; }
  Image pictureBeforeSky(const SquareScene& square) {
    auto picture = render(square);
    addSky(picture, square.request.camera, kSky);
    return picture.image;
  }
  static void expectNear(glm::vec3 actual, glm::vec3 expected, float tolerance = 1e-4F) {
    for (int channel = 0; channel < 3; ++channel) EXPECT_NEAR(actual[channel], expected[channel], tolerance);
  }
  inline static const scene::Sky kSky{{3.0F, 4.0F, 6.0F}, {0.5F, 0.25F, 0.125F}};
  std::unique_ptr<ViewRenderer> renderer_;
};

TEST_F(View, LitIsAlbedoTimesIrradianceOverPiPlusEmission) {
  const SquareScene square;
  const auto image = picture(square);
  for (const auto& pixel : image.pixels) expectNear(pixel, {0.25F, 2.125F, 0.5F});
}

TEST_F(View, QuantitiesAreWhatTheirNamesSay) {
  SquareScene square;
  square.request.quantity = ViewQuantity::kIrradiance;
  expectNear(picture(square).at(5, 9), glm::vec3(kPi));
  square.request.quantity = ViewQuantity::kRadiosity;
  expectNear(picture(square).at(5, 9), kPi * glm::vec3(0.25F, 2.125F, 0.5F), 1e-3F);
  square.request.quantity = ViewQuantity::kNormal;
  expectNear(picture(square).at(5, 9), {0.5F, 0.5F, 1.0F}, 0.01F);
}

TEST_F(View, TheLightmapIsLookedUpBilinearlyAtTexelCentres) {
  SquareScene square;
  square.request.quantity = ViewQuantity::kIrradiance;
  square.request.width = square.request.height = 4;  // a pixel's centre is a texel's centre
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 4; ++x) square.pages[0].at(x, y) = glm::vec3(x, y, 0);
  }
  const auto image = picture(square);
  // v = 0 is row 0 of the page and lies at the square's lower edge here, the picture's last row
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 4; ++x) expectNear(image.at(x, 3 - y), glm::vec3(x, y, 0), 0.02F);
  }
}

TEST_F(View, ABackIsDrawnWithItsOwnTexelsOrNotAtAll) {
  SquareScene square;
  square.request.camera.world =
      glm::rotate(glm::dmat4(1.0), std::numbers::pi, glm::dvec3(0, 1, 0)) * square.request.camera.world;
  expectNear(picture(square).at(16, 16), glm::vec3(0.0F));
  auto& uvs = square.patches.instance_uvs[0];
  uvs.side[1] = uvs.side[0];
  uvs.side[1].page = {1, 1};
  square.patches.pages.push_back({4, 4});
  square.pages.emplace_back(4, 4, glm::vec3(2.0F * kPi));
  expectNear(picture(square).at(16, 16), {0.5F, 2.25F, 1.0F});
  square.request.camera.world = glm::translate(glm::dmat4(1.0), glm::dvec3(0, 0, 1));
  expectNear(picture(square).at(16, 16), {0.25F, 2.125F, 0.5F});
}

TEST_F(View, AMirroredInstanceShowsItsFront) {
  SquareScene square;
  square.scene.instances[0].world = glm::scale(glm::dmat4(1.0), glm::dvec3(-1, 1, 1));
  expectNear(picture(square).at(16, 16), {0.25F, 2.125F, 0.5F});
}

TEST_F(View, TexturesAreDecodedFromSrgb) {
  SquareScene square;
  scene::Texture texture;
  texture.width = texture.height = 1;
  texture.rgba = {188, 188, 188, 255};  // 0.5029 linear
  square.scene.textures = {texture};
  square.scene.materials[0].base_color_texture.texture = 0;
  expectNear(picture(square).at(3, 3), {0.25F * 0.503F, 2.0F + 0.125F * 0.503F, 0.5F * 0.503F}, 2e-3F);
}

TEST_F(View, AnAlphaMaskCutsOut) {
  SquareScene square;
  scene::Texture texture;
  texture.width = 2;
  texture.height = 1;
  texture.rgba = {255, 255, 255, 0, 255, 255, 255, 255};
  square.scene.textures = {texture};
  square.scene.materials[0].base_color_texture.texture = 0;
  square.scene.materials[0].alpha_mode = scene::AlphaMode::kMask;
  const auto image = picture(square);
  expectNear(image.at(8, 16), glm::vec3(0.0F));
  EXPECT_GT(image.at(24, 16).y, 2.0F);
}

TEST_F(View, ABlendedSurfaceCoversItsAlphaOfThePicture) {
  SquareScene square;
  const auto opaque = picture(square).at(16, 16);
  square.scene.materials[0].alpha_mode = scene::AlphaMode::kBlend;
  square.scene.materials[0].alpha = 0.6F;
  const auto image = picture(square);
  glm::vec3 mean(0.0F);
  for (int i = 0; i < 256; ++i) mean += image.at(8 + i % 16, 8 + i / 16) / 256.0F;
  // 2 or 3 of 4 samples, by chance: sigma 0.12 / sqrt(256)
  expectNear(mean, 0.6F * opaque, 0.025F * opaque.y);
}

TEST_F(View, EdgesAreAntialiased) {
  SquareScene square;
  square.request.camera.world =
      glm::rotate(glm::dmat4(1.0), 0.3, glm::dvec3(0, 0, 1)) * glm::translate(glm::dmat4(1.0), glm::dvec3(0, 0, 1.7));
  const auto image = picture(square);
  const auto between =
      std::count_if(image.pixels.begin(), image.pixels.end(), [](glm::vec3 p) { return p.y > 0.1F && p.y < 2.0F; });
  EXPECT_GT(between, 20);
}

TEST_F(View, ASceneFarFromTheOriginKeepsItsEdges) {
  SquareScene square;
  const auto away = glm::translate(glm::dmat4(1.0), glm::dvec3(1e7, -3e7, 2e7));
  const auto near_picture = picture(square);
  square.scene.instances[0].world = away;
  square.request.camera.world = away * square.request.camera.world;
  EXPECT_EQ(picture(square).pixels, near_picture.pixels);
}

TEST_F(View, WhereNothingIsHitTheSkyIsSeenByTheDirectionOfEachPixel) {
  SquareScene square;
  auto turn = glm::rotate(glm::dmat4(1.0), 2.4, glm::dvec3(0, 1, 0));  // away from the square, nodding and leaning
  turn = glm::rotate(glm::rotate(turn, 0.2, glm::dvec3(1, 0, 0)), 0.4, glm::dvec3(0, 0, 1));
  square.request.camera.world = glm::translate(glm::dmat4(1.0), glm::dvec3(0, 0, 1)) * turn;
  square.request.camera.yfov_rad = 1.2;
  square.request.width = 40;
  const auto image = pictureBeforeSky(square);
  int above = 0, below = 0, mixed = 0;
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 40; ++x) {
      const double half = std::tan(0.6);
      const auto height = [&](double right, double down) {
        const glm::dvec3 ray((right / 20.0 - 1.0) * half * 1.25, (1.0 - down / 16.0) * half, -1.0);
        return (glm::dmat3(turn) * ray).y;
      };
      const auto corners = {height(x, y), height(x + 1, y), height(x, y + 1), height(x + 1, y + 1)};
      const auto& seen = image.at(x, y);
      if (std::min(corners) > 0.0) {
        ++above;
        expectNear(seen, kSky.upper);
      } else if (std::max(corners) < 0.0) {
        ++below;
        expectNear(seen, kSky.lower);
      } else {  // the horizon crosses it
        ++mixed;
        EXPECT_GE(seen.y, kSky.lower.y);
        EXPECT_LE(seen.y, kSky.upper.y);
      }
    }
  }
  EXPECT_GT(above, 300);
  EXPECT_GT(below, 300);
  EXPECT_GT(mixed, 20);
}

TEST_F(View, OfTheSkyIsSeenWhatAMaskCutsOutAndABlendLetsThrough) {
  SquareScene square;
  square.request.camera.world = glm::translate(glm::dmat4(1.0), glm::dvec3(0, 0, 1));
  scene::Texture texture;
  texture.width = 2;
  texture.height = 1;
  texture.rgba = {255, 255, 255, 0, 255, 255, 255, 255};
  square.scene.textures = {texture};
  auto& material = square.scene.materials[0];
  material.base_color_texture.texture = 0;
  material.alpha_mode = scene::AlphaMode::kMask;
  const auto cut = pictureBeforeSky(square);
  expectNear(cut.at(8, 4), kSky.upper);
  expectNear(cut.at(8, 28), kSky.lower);
  expectNear(cut.at(24, 4), {0.25F, 2.125F, 0.5F});
  material.base_color_texture.texture = scene::kNone;
  material.alpha_mode = scene::AlphaMode::kBlend;
  material.alpha = 0.6F;
  const auto image = pictureBeforeSky(square);
  glm::vec3 mean(0.0F);
  for (int i = 0; i < 256; ++i) mean += image.at(i % 32, i / 32) / 256.0F;  // the upper quarter
  // 2 or 3 of 4 samples, by chance: sigma 0.12 / sqrt(256), of what square and sky differ by
  expectNear(mean, 0.6F * glm::vec3(0.25F, 2.125F, 0.5F) + 0.4F * kSky.upper, 0.15F);
}

TEST_F(View, ASurfaceHidesTheSkyAndItsEdgeSharesThePixel) {
  SquareScene square;
  for (const auto& pixel : pictureBeforeSky(square).pixels) expectNear(pixel, {0.25F, 2.125F, 0.5F});
  square.request.camera.world =
      glm::rotate(glm::dmat4(1.0), 0.3, glm::dvec3(0, 0, 1)) * glm::translate(glm::dmat4(1.0), glm::dvec3(0, 0, 1.7));
  const auto picture = render(square);
  const auto image = pictureBeforeSky(square);
  int shared = 0;
  for (std::size_t i = 0; i < 8 * 32; ++i) {  // well above the horizon
    const float cover = picture.cover[i];
    if (cover > 0.0F && cover < 1.0F) ++shared;
    expectNear(image.pixels[i], cover * glm::vec3(0.25F, 2.125F, 0.5F) + (1.0F - cover) * kSky.upper, 1e-3F);
  }
  EXPECT_GT(shared, 3);
}

TEST_F(View, ALargePictureIsTheSmallOneDrawnFiner) {
  SquareScene square;
  for (int y = 0; y < 4; ++y)
    for (int x = 0; x < 4; ++x) square.pages[0].at(x, y) = kPi * glm::vec3(x, y, x * y);
  square.request.width = square.request.height = 64;
  const auto small = render(square);
  constexpr int kFiner = 17;  // odd, so that each pixel has one in its middle; 1088 pixels: several tiles, and parts
  square.request.width = square.request.height = kFiner * 64;
  const auto large = render(square);
  for (int y = 0; y < 64; ++y)
    for (int x = 0; x < 64; ++x)
      expectNear(large.image.at(kFiner * x + kFiner / 2, kFiner * y + kFiner / 2), small.image.at(x, y), 0.02F);
  for (const float cover : large.cover) ASSERT_EQ(cover, 1.0F);
}

TEST_F(View, APictureThatIsCalledOffIsNotDrawn) {
  const SquareScene square;
  Task task;
  const TaskScope scope(&task);
  task.cancel();
  EXPECT_THROW((void)renderer_->render(square.scene, square.patches, square.pages, square.request), Interrupted);
}

TEST_F(View, AnAbsurdSizeIsRefused) {
  SquareScene square;
  square.request.width = 100000;
  EXPECT_FALSE(renderer_->render(square.scene, square.patches, square.pages, square.request).has_value());
}

}  // namespace
}  // namespace radiosity::gpu
