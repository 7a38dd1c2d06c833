// What became of the scene since it was loaded: a log of revisions, and the edits that can be taken back and made
// again. Bounded: 256 revisions, 256 edits, 16 MiB of patches; what is older is forgotten. Solve thread only.
#pragma once

#include <cstdint>
#include <deque>
#include <string>
#include <vector>

#include "common/bytes.h"
#include "server/engine/engine.h"
#include "server/scene/document.h"

namespace radiosity::engine {

class History {
 public:
  struct Bounds {
    std::size_t revisions = 256, edits = 256, patch_bytes = std::size_t{16} << 20;
  };
  History() = default;
  explicit History(const Bounds& bounds) : bounds_(bounds) {}

  /// Another scene: nothing before it can come back.
  void loaded(std::uint64_t revision, const std::string& name);

  /// An edit was made; what had been taken back can no longer be made again.
  void edited(std::uint64_t revision, const std::string& by, const nlohmann::json& patch, const scene::Document& before,
              const scene::Document& after);

  /// The document one edit back or forth, and the patch that leads there (plain RFC 6902, as JSON text).
  struct Step {
    scene::Document document;
    std::string patch;
    std::uint64_t edit = 0;  ///< revision that the edit had made when it was new
  };
  /// kNotFound where there is nothing to take back or to make again. Changes nothing: the step may yet fail.
  [[nodiscard]] Result<Step> step(bool redo, const scene::Document& now) const;
  /// The step was taken.
  void stepped(std::uint64_t revision, const std::string& by, bool redo);

  [[nodiscard]] HistoryReport report(std::uint64_t revision) const;

 private:
  struct Edit {
    std::uint64_t revision = 0;
    std::string forth, back;                   // JSON Patches
    std::vector<SharedBytes> buffers, images;  // that it appended
    std::size_t buffers_before = 0, images_before = 0;
    [[nodiscard]] std::size_t bytes() const { return forth.size() + back.size(); }
  };
  void log(PastRevision entry);
  [[nodiscard]] std::size_t patchBytes() const;

  Bounds bounds_;
  std::deque<PastRevision> log_;
  std::deque<Edit> edits_;
  std::size_t done_ = 0;  // of edits_; those behind are taken back
};

}  // namespace radiosity::engine
