// The bounded memory of edits, without an engine around it.
#include <gmock/gmock.h>

#include "server/engine/persist/history.h"

namespace radiosity::engine {
namespace {

using nlohmann::json;

SharedBytes bytesOf(std::size_t size) { return std::make_shared<const Bytes>(size); }

/// Makes edits as the engine does and holds the document.
struct Editing {
  explicit Editing(const History::Bounds& bounds = {}) : history(bounds) { history.loaded(1, "ann", "room.glb"); }

  void edit(const std::string& pointer, const json& value, const std::string& by = "ann") {
    auto next = document;
    next.gltf[json::json_pointer(pointer)] = value;
    commit(std::move(next), json::array({{{"op", "add"}, {"path", pointer}, {"value", value}}}), by);
  }
  void commit(scene::Document next, const json& patch, const std::string& by = "ann") {
    history.edited(++revision, by, patch, document, next);
    document = std::move(next);
  }
  bool step(bool redo) {
    auto step = history.step(redo, document);
    if (!step) return false;
    document = std::move(step->document);
    history.stepped(++revision, "ben", redo);
    return true;
  }

  History history;
  scene::Document document{"room.glb", {{"a", {0, 0, 0}}}, {bytesOf(3)}, {}};
  std::uint64_t revision = 1;
};

TEST(History, StepsBackAndForthThroughAllThatWasMade) {
  Editing editing;
  std::vector<json> seen{editing.document.gltf};
  for (int i = 0; i < 5; ++i) {
    editing.edit("/b" + std::to_string(i % 2), {{"n", i}});
    seen.push_back(editing.document.gltf);
  }
  for (int i = 4; i >= 0; --i) {
    ASSERT_TRUE(editing.step(false));
    EXPECT_EQ(editing.document.gltf, seen[static_cast<std::size_t>(i)]);
  }
  EXPECT_FALSE(editing.step(false));
  EXPECT_EQ(editing.history.step(false, editing.document).error().code, ErrorCode::kNotFound);
  for (std::size_t i = 1; i <= 5; ++i) {
    ASSERT_TRUE(editing.step(true));
    EXPECT_EQ(editing.document.gltf, seen[i]);
  }
  EXPECT_FALSE(editing.step(true));
}

TEST(History, ANewEditForgetsWhatWasTakenBack) {
  Editing editing;
  editing.edit("/x", 1);
  editing.edit("/x", 2);
  ASSERT_TRUE(editing.step(false));
  editing.edit("/x", 3);
  EXPECT_FALSE(editing.step(true));
  ASSERT_TRUE(editing.step(false));
  EXPECT_EQ(editing.document.gltf["x"], 1);
}

TEST(History, BytesThatAnEditBroughtComeAndGoWithIt) {
  Editing editing;
  auto next = editing.document;
  next.buffers.push_back(bytesOf(7));
  next.images.push_back(bytesOf(9));
  next.gltf["buffers"] = json::array({{{"byteLength", 7}}});
  const auto buffer = next.buffers[1];
  editing.commit(std::move(next), json::array());
  ASSERT_TRUE(editing.step(false));
  EXPECT_EQ(editing.document.buffers.size(), 1U);
  EXPECT_TRUE(editing.document.images.empty());
  ASSERT_TRUE(editing.step(true));
  EXPECT_EQ(editing.document.buffers.at(1), buffer);
  EXPECT_EQ(editing.document.images.size(), 1U);
}

TEST(History, TellsWhoDidWhat) {
  Editing editing;
  editing.edit("/x", 1, "ann");
  editing.commit(editing.document, R"([{"op":"test","path":"/x","value":1},{"op":"replace","path":"/x","value":2},
                                       {"op":"remove","path":"/y"}])"_json,
                 "cleo");
  ASSERT_TRUE(editing.step(false));
  const auto report = editing.history.report(editing.revision);
  EXPECT_EQ(report.revision, 4U);
  EXPECT_EQ(report.undoable, 1U);
  EXPECT_EQ(report.redoable, 1U);
  ASSERT_EQ(report.revisions.size(), 4U);
  EXPECT_EQ(report.revisions[0].kind, PastRevision::Kind::kLoad);
  EXPECT_EQ(report.revisions[0].summary, "room.glb");
  EXPECT_EQ(report.revisions[0].by, "ann");
  EXPECT_EQ(report.revisions[1].by, "ann");
  EXPECT_EQ(report.revisions[1].summary, "add /x");
  EXPECT_FALSE(report.revisions[1].undone);
  EXPECT_EQ(report.revisions[2].summary, "replace /x and 1 more");
  EXPECT_TRUE(report.revisions[2].undone);
  EXPECT_EQ(report.revisions[3].kind, PastRevision::Kind::kUndo);
  EXPECT_EQ(report.revisions[3].by, "ben");
  EXPECT_EQ(report.revisions[3].stepped, 3U);
  EXPECT_GT(report.revisions[3].time_s, 1.6e9);
}

TEST(History, IsBounded) {
  Editing editing({.revisions = 10, .edits = 4, .patch_bytes = 4000});
  for (int i = 0; i < 50; ++i) editing.edit("/x", i);
  EXPECT_EQ(editing.history.report(0).undoable, 4U);
  EXPECT_EQ(editing.history.report(0).revisions.size(), 10U);
  for (int i = 0; i < 4; ++i) editing.edit("/x", std::string(900, static_cast<char>('a' + i)));
  EXPECT_EQ(editing.history.report(0).undoable, 2U);  // each leads there and back: some 1,900 bytes
  editing.edit("/x", std::string(5000, 'z'));
  EXPECT_EQ(editing.history.report(0).undoable, 0U);
  editing.edit("/" + std::string(500, 'n'), "\u00e4");
  EXPECT_LE(editing.history.report(0).revisions.back().summary.size(), 200U);
}

TEST(History, ALoadedSceneHasNoPast) {
  Editing editing;
  editing.edit("/x", 1);
  editing.history.loaded(3, "ben", "other.glb");
  EXPECT_FALSE(editing.step(false));
  ASSERT_EQ(editing.history.report(3).revisions.size(), 1U);
  EXPECT_EQ(editing.history.report(3).revisions[0].by, "ben");
}

TEST(History, TellsSinceWhenTheSceneIsTheSame) {
  History history({.revisions = 10});
  EXPECT_FALSE(history.isSameSceneSince(0));
  history.loaded(4, "ann", "room.glb");
  EXPECT_FALSE(history.isSameSceneSince(3));
  EXPECT_TRUE(history.isSameSceneSince(4));
  EXPECT_FALSE(history.isSameSceneSince(5));  // which nobody can have seen
  const scene::Document document{"room.glb", {{"a", 1}}, {}, {}};
  for (std::uint64_t revision = 5; revision < 40; ++revision)
    history.edited(revision, "ann", json::array(), document, document);
  EXPECT_TRUE(history.isSameSceneSince(4)) << "though the log has forgotten it";
  History again({.revisions = 10});
  again.restore(history.report(39).revisions, {}, 0);
  EXPECT_FALSE(again.isSameSceneSince(28)) << "of which the log of another process says nothing";
  EXPECT_TRUE(again.isSameSceneSince(29));
  history.loaded(40, "ben", "other.glb");
  EXPECT_FALSE(history.isSameSceneSince(39));
  EXPECT_TRUE(history.isSameSceneSince(40));
  again.restore(history.report(40).revisions, {}, 0);
  EXPECT_FALSE(again.isSameSceneSince(39));
  EXPECT_TRUE(again.isSameSceneSince(40));
}

}  // namespace
}  // namespace radiosity::engine
