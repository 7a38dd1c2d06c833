// KTX2 pictures of scene files (KHR_texture_basisu), which the server does not read. A script and the transcoder of
// Basis Universal, both part of this program, turn them into PNGs; node runs them.
#pragma once

#include <memory>
#include <string>

#include "common/result.h"

namespace radiosity::cli {

/// A scene file to be sent: the user's own, or a copy that goes when this does.
class SceneToSend {
 public:
  explicit SceneToSend(std::string path) : path_(std::move(path)) {}

  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  friend Result<SceneToSend> withoutKtx2(const std::string& path);
  std::string path_;
  std::shared_ptr<const void> folder_;  ///< removed with the last who has it
};

/// Whether a texture has no picture but one of KTX2. A file that cannot be read has none: whoever reads it next says
/// why.
[[nodiscard]] bool needsKtx2(const std::string& path);

/// The file itself where no picture has to be decoded, else a copy of it with PNGs, a .gltf with its external files
/// packed into it. Errors: a picture that is no KTX2 or damaged, named with its JSON pointer; node is missing, or does
/// not end, or the program was built without the transcoder; kCancelled within 50 ms of a signal. Takes about a second
/// for ten megapixels.
[[nodiscard]] Result<SceneToSend> withoutKtx2(const std::string& path);

}  // namespace radiosity::cli
