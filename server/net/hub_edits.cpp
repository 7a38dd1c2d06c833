// Edits: each made once however often it is asked for, and the uploads that they refer to.
#include <fmt/format.h>

#include <utility>

#include "common/log.h"
#include "common/sha256.h"
#include "server/net/convert.h"
#include "server/net/hub.h"

namespace radiosity::net {

void Hub::askOnce(const engine::Receipt& receipt, const std::string& by, EditAnswer done,
                  const std::function<void(engine::Engine::Callback<engine::PatchOutcome>)>& ask) {
  const auto& [request_id, fingerprint] = receipt;
  if (!request_id.empty()) {
    const std::lock_guard lock(mutex_);
    const auto [found, inserted] = remembered_.try_emplace(request_id);
    auto& known = found->second;
    if (inserted) known.fingerprint = fingerprint;
    if (known.fingerprint != fingerprint)
      return done(tl::unexpected(protocol::RpcError{protocol::RpcCode::kInvalidParams,
                                                    "this requestId was used for another edit", "/params/requestId"}));
    if (known.answer) return done(*known.answer);
    known.waiting.push_back(std::move(done));
    if (!inserted) return;
    done = [this, request_id = receipt.request_id](const auto& answer) { remember(request_id, answer); };
  }
  ask(fromEngine<engine::PatchOutcome>(
      [this, done, request_id = receipt.request_id, by](const Result<engine::PatchOutcome>& outcome) {
        if (outcome) {
          sawRevision(outcome->revision);
          const LogScope about({.revision = outcome->revision, .request_id = request_id});
          log::info("edit by {}: {} surfaces, {} shots to do again", by, outcome->affected_surfaces,
                    outcome->affected_shots);
          return done(protocol::SceneStepReply{outcome->revision, outcome->affected_surfaces, outcome->affected_shots,
                                               outcome->stepped});
        }
        const LogScope about({.revision = revision(), .request_id = request_id});
        log::info("edit by {} refused: {}", by, outcome.error().text());
        auto error = protocol::toRpcError(outcome.error());
        error.revision = revision();
        done(tl::unexpected(std::move(error)));
      }));
}

void Hub::keepUpload(const std::string& id, const std::string& name, const SharedBytes& bytes,
                     std::function<void(const Result<std::string>&)> done) {
  auto put = uploads_.put(id, name, bytes);
  if (!options_.uploads) return done(std::move(put.id));
  std::vector<std::string> dropped;
  for (const auto& blob : put.dropped) dropped.push_back(blob.id);
  state::Uploads::Entry entry{put.id, name};
  const auto heard = [self = shared_from_this(), put = std::move(put),
                      done = std::move(done)](const Result<void>& kept) {
    self->enter([&] {
      if (kept) return done(put.id);
      log::error("an upload is refused, it cannot be kept: {}", kept.error().text());
      self->uploads_.takeBack(put);
      done(tl::unexpected(kept.error()));
    });
  };
  options_.uploads->keep(std::move(entry), bytes, std::move(dropped), heard);
}

std::optional<BlobStore::Blob> Hub::findUpload(std::string_view id) {
  auto blob = uploads_.find(id);
  if (!blob || blob->bytes || !options_.uploads) return blob;
  auto bytes = options_.uploads->read(blob->id);
  if (!bytes) {
    log::error("{}", bytes.error().text());
    uploads_.drop(id);
    return std::nullopt;
  }
  blob->bytes = std::move(*bytes);
  (void)uploads_.put(blob->id, blob->name, blob->bytes);
  return blob;
}

SharedBytes Hub::upload(const std::string& uri) {
  constexpr std::string_view kUpload = "/uploads/";
  if (!uri.starts_with(kUpload)) return nullptr;
  const auto blob = findUpload(std::string_view(uri).substr(kUpload.size()));
  return blob ? blob->bytes : nullptr;
}

void Hub::patch(const protocol::ScenePatchCall& call, const engine::Client& by, EditAnswer done) {
  auto text = fmt::format("{}|{}|{}", call.base_revision.value_or(0), call.dry_run, call.patch);
  if (call.same_scene_as) text += fmt::format("|{}", *call.same_scene_as);  // others' are kept over a restart
  // A dry run changes nothing: the edit itself may come with the same id.
  const bool once = !call.dry_run && !call.request_id.empty();
  const auto receipt = once ? engine::Receipt{call.request_id, fingerprintOf(text)} : engine::Receipt{};
  engine::PatchRequest request{
      .patch = call.patch,
      .base_revision = call.base_revision,
      .same_scene_as = call.same_scene_as,
      .dry_run = call.dry_run,
      .by = by.name,
      .find_upload = [self = shared_from_this()](const auto& uri) { return self->upload(uri); },
      .receipt = receipt,
      .session = by.session};
  askOnce(receipt, by.name, std::move(done), [&](auto heard) { engine_.patch(std::move(request), std::move(heard)); });
}

void Hub::step(bool redo, std::optional<std::uint64_t> base_revision, const std::string& request_id,
               const engine::Client& by, EditAnswer done) {
  const auto text = fmt::format("{}|{}", base_revision.value_or(0), redo ? "redo" : "undo");
  const engine::Receipt receipt{request_id, request_id.empty() ? 0 : fingerprintOf(text)};
  askOnce(receipt, by.name, std::move(done), [&](auto heard) {
    engine_.step({redo, base_revision, by.name, receipt, by.session}, std::move(heard));
  });
}

void Hub::remember(const std::string& request_id, const EditResult& answer) {
  constexpr std::size_t kKept = 1024;
  std::vector<EditAnswer> waiting;
  {
    const std::lock_guard lock(mutex_);
    auto& known = remembered_[request_id];
    waiting.swap(known.waiting);
    const bool again = !answer && (answer.error().code == protocol::RpcCode::kRateLimited ||
                                   answer.error().code == protocol::RpcCode::kUnavailable);
    if (again) {  // nothing was decided: the same id may be tried again
      remembered_.erase(request_id);
    } else {
      known.answer = answer;
      remembered_order_.push_back(request_id);
    }
    while (remembered_order_.size() > kKept) {
      remembered_.erase(remembered_order_.front());
      remembered_order_.pop_front();
    }
  }
  for (const auto& done : waiting) done(answer);
}

}  // namespace radiosity::net
