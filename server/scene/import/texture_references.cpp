#include "server/scene/import/texture_references.h"

namespace radiosity::scene {
namespace {

std::string nameOf(const Json& gltf, const std::optional<std::size_t>& index) {
  if (!index) return "its image";
  const auto& image = gltf["images"][*index];
  const auto number = "image " + std::to_string(*index);
  return image.contains("name") ? number + " ('" + image["name"].get<std::string>() + "')" : number;
}

}  // namespace

Result<void> checkIsNoKtx2(const Document& document, std::size_t texture) {
  constexpr const char* kBasisu = "KHR_texture_basisu";
  const auto& gltf = document.gltf;
  const auto& json = gltf["textures"][texture];
  const auto* basisu = extensionOf(json, kBasisu);
  const auto count = document.images.size();
  if (basisu == nullptr || imageReferenceOf(json, count)) return {};
  return fail(ErrorCode::kUnsupported,
              nameOf(gltf, referenceOf(*basisu, "source", count)) +
                  " is KTX2, which the server does not decode: open the file in the viewer or send it with "
                  "'radiosity', which make a PNG of it, or export it as PNG, JPEG or WebP",
              place(document.name, "/textures/" + std::to_string(texture) + "/extensions/" + kBasisu));
}

}  // namespace radiosity::scene
