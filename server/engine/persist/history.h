// What became of the scene since it was loaded: a log of revisions, and the edits that can be taken back and made
// again. Bounded: 256 revisions, 256 edits, 16 MiB of patches; what is older is forgotten. Solve thread only.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "common/bytes.h"
#include "server/engine/engine.h"
#include "server/scene/document/document.h"
#include "server/state/store.h"

namespace radiosity::engine {

class History {
 public:
  struct Bounds {
    std::size_t revisions = 256, edits = 256, patch_bytes = std::size_t{16} << 20;
  };
  History() = default;
  explicit History(const Bounds& bounds) : bounds_(bounds) {}

  /// A revision that is about to come: written to the disk first, then taken over.
  struct Next {
    PastRevision entry;
    std::string patch;                     ///< plain RFC 6902 that leads there, as JSON text
    state::Appended appended;              ///< buffers and images that come with it, and how many stay
    std::optional<state::Edit> edit;       ///< a new edit that can be taken back
    std::vector<std::uint64_t> forgotten;  ///< edits that no longer can be taken back or made again
    std::size_t done = 0;                  ///< of the edits; those behind are taken back
  };
  /// Another scene: nothing before it can come back.
  [[nodiscard]] static Next nextLoad(std::uint64_t revision, const std::string& by, const std::string& name);
  /// An edit of `parts`; what had been taken back can then no longer be made again.
  [[nodiscard]] Next nextEdit(std::uint64_t revision, const std::string& by, const nlohmann::json& patch,
                              const scene::Document& before, const scene::Document& after,
                              const scene::TouchedParts& parts = {}) const;
  /// One edit back, or forth again; there must be one.
  [[nodiscard]] Next nextStep(std::uint64_t revision, const std::string& by, bool redo) const;
  /// Before the revision is written: take() then fails for nothing, not for want of memory either.
  void makeRoom();
  void take(Next next);

  /// nextLoad() and take() in one.
  void loaded(std::uint64_t revision, const std::string& by, const std::string& name) {
    take(nextLoad(revision, by, name));
  }
  /// nextEdit() and take() in one.
  void edited(std::uint64_t revision, const std::string& by, const nlohmann::json& patch, const scene::Document& before,
              const scene::Document& after) {
    take(nextEdit(revision, by, patch, before, after));
  }

  /// The document one edit back or forth, and the patch that leads there (plain RFC 6902, as JSON text).
  struct Step {
    scene::Document document;
    std::string patch;
    std::uint64_t edit = 0;  ///< revision that the edit had made when it was new
  };
  /// kNotFound where there is nothing to take back or to make again. Changes nothing: the step may yet fail.
  [[nodiscard]] Result<Step> step(bool redo, const scene::Document& now) const;
  /// nextStep() and take() in one.
  void stepped(std::uint64_t revision, const std::string& by, bool redo) { take(nextStep(revision, by, redo)); }

  /// What outlived the last process: a log whose `undone` is not set yet, and edits of which so many are done.
  void restore(std::vector<PastRevision> log, std::vector<state::Edit> edits, std::size_t done);

  /// Whether that revision is there, and no other scene was loaded after it.
  [[nodiscard]] bool isSameSceneSince(std::uint64_t revision) const;

  [[nodiscard]] HistoryReport report(std::uint64_t revision) const;

 private:
  void log(PastRevision entry);
  void noteStep(const PastRevision& entry);

  Bounds bounds_;
  std::vector<PastRevision> log_;
  std::vector<state::Edit> edits_;
  std::size_t done_ = 0;          // of edits_; those behind are taken back
  std::uint64_t same_since_ = 0;  // the first revision of this scene, or of what is known of it after a restart
};

}  // namespace radiosity::engine
