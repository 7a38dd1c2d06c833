// radiosity set, move, rotate, scale, hide, show, remove, add, sky, undo, redo, history: short forms of what people do
// most.
#include <fmt/chrono.h>
#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>

#include "client/cli/commands.h"
#include "client/cli/editor.h"
#include "client/cli/ktx2.h"
#include "client/cli/model_merge.h"
#include "client/cli/scene_edits.h"
#include "client/cli/scene_file.h"
#include "client/cli/sky_options.h"
#include "common/one_line.h"
#include "protocol/http_bodies.h"

namespace radiosity::cli {
namespace {

constexpr const char* kNodeHelp = "the node: @NAME, or /nodes/N";

struct NodeOptions {
  RemoteOptions server;
  std::string node;
};

ExitCode editAndPrint(const RemoteOptions& server, const MakePatch& make) {
  const auto remote = remoteFrom(server);
  if (!remote) return complain(remote.error());
  const auto reply = editScene(*remote, make);
  if (!reply) return complain(reply.error());
  printEdit(reply->revision, reply->affected_surfaces, reply->affected_shots);
  return ExitCode::kOk;
}

CLI::App& nodeCommand(CLI::App& app, const char* name, const char* what, NodeOptions& options) {
  auto& command = *app.add_subcommand(name, what);
  addRemoteOptions(command, options.server);
  command.add_option("NODE", options.node, kNodeHelp)->required()->type_name("");
  return command;
}

void addSet(CLI::App& app, Run& run) {
  struct Options {
    RemoteOptions server;
    std::string target, value;
  };
  auto options = std::make_shared<Options>();
  auto& command = *app.add_subcommand("set", "set a property: @lamp.emissiveStrength 20");
  addRemoteOptions(command, options->server);
  command.add_option("TARGET", options->target, "@NAME.PROPERTY, or a JSON pointer into the glTF")
      ->required()
      ->type_name("");
  command
      .add_option("VALUE", options->value,
                  "number, word, JSON, or numbers with commas; for a colour one number is grey")
      ->required()
      ->type_name("");
  command.footer(
      "Properties (NAME is that of the material, light or node, or of a node that has such a material or light):\n" +
      propertyHelp());
  command.callback([options, &run] {
    run = [options] {
      return editAndPrint(options->server,
                          [&](const Json& gltf) { return setPatch(gltf, options->target, options->value); });
    };
  });
}

void addMove(CLI::App& app, Run& run) {
  struct Options : NodeOptions {
    std::array<double, 3> metres{};
    bool relative = false;
  };
  auto options = std::make_shared<Options>();
  auto& command = nodeCommand(app, "move", "move a node, and what is below it", *options);
  command.add_option("XYZ", options->metres, "where to, in metres in the frame of the node's parent: X Y Z")
      ->required()
      ->type_name("");
  command.add_flag("--by", options->relative, "by so much, rather than to there");
  command.callback([options, &run] {
    run = [options] {
      return editAndPrint(options->server, [&](const Json& gltf) {
        return movePatch(gltf, options->node, options->metres, options->relative);
      });
    };
  });
}

void addRotate(CLI::App& app, Run& run) {
  struct Options : NodeOptions {
    double degrees = 0.0;
    std::array<double, 3> axis{0.0, 1.0, 0.0};
    bool absolute = false;
  };
  auto options = std::make_shared<Options>();
  auto& command = nodeCommand(app, "rotate", "turn a node about an axis through its origin", *options);
  command.add_option("DEGREES", options->degrees, "counter-clockwise when the axis points at the eye")
      ->required()
      ->type_name("");
  command.add_option("--axis", options->axis, "in the frame of the node's parent (default: 0 1 0, up)")
      ->type_name("X Y Z");
  command.add_flag("--to", options->absolute, "from no rotation at all, rather than from where it is");
  command.callback([options, &run] {
    run = [options] {
      return editAndPrint(options->server, [&](const Json& gltf) {
        return rotatePatch(gltf, options->node, options->degrees, options->axis, options->absolute);
      });
    };
  });
}

void addScale(CLI::App& app, Run& run) {
  struct Options : NodeOptions {
    std::vector<double> factor;
  };
  auto options = std::make_shared<Options>();
  auto& command = nodeCommand(app, "scale", "make a node larger or smaller", *options);
  command.add_option("FACTOR", options->factor, "one number, or X Y Z; none of them 0")
      ->required()
      ->expected(1, 3)
      ->type_name("");
  command.callback([options, &run] {
    run = [options]() -> ExitCode {
      auto f = options->factor;
      if (f.size() == 2) return complain(Error{ErrorCode::kBadUsage, "FACTOR is one number, or three", {}});
      f.resize(3, f[0]);
      return editAndPrint(options->server, [&](const Json& gltf) {
        return scalePatch(gltf, options->node, {f[0], f[1], f[2]});
      });
    };
  });
}

void addVisibility(CLI::App& app, Run& run, const char* name, const char* what, bool visible) {
  auto options = std::make_shared<NodeOptions>();
  auto& command = nodeCommand(app, name, what, *options);
  command.callback([options, visible, &run] {
    run = [options, visible] {
      return editAndPrint(options->server,
                          [&](const Json& gltf) { return visibilityPatch(gltf, options->node, visible); });
    };
  });
}

void addRemove(CLI::App& app, Run& run) {
  auto options = std::make_shared<NodeOptions>();
  auto& command = nodeCommand(app, "remove", "take a node, and what is below it, out of the scene", *options);
  command.callback([options, &run] {
    run = [options] {
      return editAndPrint(options->server, [&](const Json& gltf) { return removePatch(gltf, options->node); });
    };
  });
}

// ---- add ----

struct AddOptions {
  RemoteOptions server;
  std::string file, name, parent;
  std::array<double, 3> at{};
};

Result<Model> readModel(const std::string& path) {
  const auto kind = sceneKind(path);
  if (!kind) return tl::unexpected(kind.error());
  const auto scene = withoutKtx2(path);
  if (!scene) return tl::unexpected(scene.error());
  if (*kind == SceneKind::kGlb) {
    std::ifstream file(scene->path(), std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(file), {}};
    if (file.bad()) return fail(ErrorCode::kBadInput, "cannot be read", path);
    return splitModel(bytes, path);
  }
  const auto text = inlineExternalFiles(scene->path());
  if (!text) return tl::unexpected(text.error());
  return Model{Json::parse(*text, nullptr, false), {}};
}

/// The upload's URI; empty where there is nothing to upload.
Result<std::string> uploadBin(const Remote& remote, std::string bin, const std::string& path) {
  if (bin.empty()) return std::string();
  const auto reply = client::httpPutText(remote.http(), "/uploads", "application/octet-stream", std::move(bin));
  if (!reply) return tl::unexpected(reply.error());
  if (!reply->ok()) return tl::unexpected(httpError(*reply, path));
  return protocol::decodeHttpUrl(reply->body);
}

ExitCode addModel(const AddOptions& options) {
  const auto remote = remoteFrom(options.server);
  if (!remote) return complain(remote.error());
  auto model = readModel(options.file);
  if (!model) return complain(model.error());
  const auto uri = uploadBin(*remote, std::move(model->bin), options.file);
  if (!uri) return complain(uri.error());
  Placement placement;
  placement.name = options.name.empty() ? std::filesystem::path(options.file).stem().string() : options.name;
  placement.translation = options.at;
  if (!options.parent.empty()) placement.parent = options.parent;
  std::string node;
  const auto reply = editScene(*remote, [&](const Json& gltf) -> Result<Json> {
    auto merge = mergeModel(gltf, model->gltf, *uri, placement);
    if (!merge && merge.error().where.empty()) merge.error().where = options.file;
    if (!merge) return tl::unexpected(merge.error());
    node = merge->node;
    return std::move(merge->patch);
  });
  if (!reply) return complain(reply.error());
  fmt::print("{}\n", node);
  printEdit(reply->revision, reply->affected_surfaces, reply->affected_shots);
  return ExitCode::kOk;
}

void addAdd(CLI::App& app, Run& run) {
  auto options = std::make_shared<AddOptions>();
  auto& command = *app.add_subcommand("add", "add the content of a file to the scene, below one new node");
  addRemoteOptions(command, options->server);
  command.add_option("FILE", options->file, ".glb (or .gltf, up to about 700 kB with its files)")
      ->required()
      ->type_name("");
  command.add_option("--at", options->at, "where, in metres (default: 0 0 0)")->type_name("X Y Z");
  command.add_option("--name", options->name, "of the new node (default: the file's)")->type_name("NAME");
  command.add_option("--parent", options->parent, "below this node, in its frame: @NAME, or /nodes/N")
      ->type_name("NODE");
  command.callback([options, &run] { run = [options] { return addModel(*options); }; });
}

// ---- sky ----

/// The sky that is there.
ExitCode turnSky(const Remote& remote, const SkyOptions& options) {
  const auto reply = editScene(remote, [&](const Json& gltf) { return skyTurnPatch(gltf, options); });
  if (!reply) return complain(reply.error());
  printEdit(reply->revision, reply->affected_surfaces, reply->affected_shots);
  return ExitCode::kOk;
}

ExitCode changeSky(const RemoteOptions& server, const SkyOptions& options) {
  const auto remote = remoteFrom(server);
  if (!remote) return complain(remote.error());
  const bool is_turn = options.sky.empty() && options.sun.empty() && !options.sun_angle && !options.turbidity;
  if (is_turn && (options.rotation || options.strength)) return turnSky(*remote, options);
  const auto choice = skyChoice(options);
  if (!choice) return complain(choice.error());
  if (choice->colours)
    return complain(Error{ErrorCode::kBadUsage, "colours are a setting of the server: a picture or a model is an edit",
                          "--sky " + options.sky});
  if (!choice->isOfScene()) return complain(Error{ErrorCode::kBadUsage, "there is neither --sky nor --sun", {}});
  auto picture = readPicture(*choice);
  if (!picture) return complain(picture.error());
  const auto bytes = picture->size();
  const auto uri = uploadBin(*remote, std::move(*picture), choice->picture);
  if (!uri) return complain(uri.error());
  const auto reply =
      editScene(*remote, [&](const Json& gltf) -> Result<Json> { return skyPatch(gltf, *choice, *uri, bytes); });
  if (!reply) return complain(reply.error());
  printEdit(reply->revision, reply->affected_surfaces, reply->affected_shots);
  return ExitCode::kOk;
}

void addSky(CLI::App& app, Run& run) {
  struct Options {
    RemoteOptions server;
    SkyOptions sky;
  };
  auto options = std::make_shared<Options>();
  auto& command = *app.add_subcommand("sky",
                                      "give the scene another sky, a picture or daylight; or turn the one it has, by "
                                      "--sky-rotation and --sky-strength alone");
  addRemoteOptions(command, options->server);
  addSkyOptions(command, options->sky);
  command.callback([options, &run] { run = [options] { return changeSky(options->server, options->sky); }; });
}

// ---- undo, redo, history ----

template <typename Call>
void addStep(CLI::App& app, Run& run, const char* name, const char* what, const char* done) {
  struct Options {
    RemoteOptions server;
    std::optional<std::uint64_t> base_revision;
  };
  auto options = std::make_shared<Options>();
  auto& command = *app.add_subcommand(name, what);
  addRemoteOptions(command, options->server);
  command.add_option("--base-revision", options->base_revision, "fail (exit 2) unless the scene is at this revision")
      ->type_name("N");
  command.callback([options, done, &run] {
    run = [options, done]() -> ExitCode {
      const auto remote = remoteFrom(options->server);
      if (!remote) return complain(remote.error());
      const auto reply = sendEdit(*remote, Call{.base_revision = options->base_revision});
      if (!reply) return complain(reply.error());
      fmt::print("{} revision {}\n", done, reply->edit);
      printEdit(reply->revision, reply->affected_surfaces, reply->affected_shots);
      return ExitCode::kOk;
    };
  });
}

void addHistory(CLI::App& app, Run& run) {
  struct Options {
    RemoteOptions server;
    std::uint64_t limit = 20;
  };
  auto options = std::make_shared<Options>();
  auto& command = *app.add_subcommand("history", "tell who changed the scene, when and how");
  addRemoteOptions(command, options->server);
  command.add_option("--limit", options->limit, "the newest so many")
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{protocol::kMaxHistory}).description(""))
      ->type_name("N")
      ->capture_default_str();
  command.callback([options, &run] {
    run = [options]() -> ExitCode {
      const auto remote = remoteFrom(options->server);
      if (!remote) return complain(remote.error());
      auto connection = remote->connect();
      if (!connection) return complain(connection.error());
      const auto reply = connection->call(protocol::SceneHistoryCall{options->limit});
      if (!reply) return complain(reply.error());
      for (const auto& past : reply->revisions) {
        fmt::print("{:6}  {:%F %T}  {:5}  {}{}{}\n", past.revision,
                   fmt::localtime(static_cast<std::time_t>(past.time_s)), oneLine(past.kind), oneLine(past.summary),
                   past.by.empty() ? "" : "  by " + oneLine(past.by), past.undone ? "  (taken back)" : "");
      }
      fmt::print("{} edits can be taken back, {} made again\n", reply->undoable, reply->redoable);
      return ExitCode::kOk;
    };
  });
}

}  // namespace

void addQuickEdits(CLI::App& app, Run& run) {
  addSet(app, run);
  addMove(app, run);
  addRotate(app, run);
  addScale(app, run);
  addVisibility(app, run, "hide", "switch a node, and what is below it, off: lights too", false);
  addVisibility(app, run, "show", "switch a node on again", true);
  addRemove(app, run);
  addAdd(app, run);
  addSky(app, run);
  addStep<protocol::SceneUndoCall>(app, run, "undo", "take the latest edit back, whoever made it", "took back");
  addStep<protocol::SceneRedoCall>(app, run, "redo", "make the edit again that was taken back last", "made again");
  addHistory(app, run);
}

}  // namespace radiosity::cli
