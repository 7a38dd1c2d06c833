#include "server/state/uploads.h"

#include <utility>

#include "server/state/store.h"

namespace radiosity::state {

Uploads::Uploads(Store& store) : store_(store), thread_([this] { work(); }) {}

Uploads::~Uploads() { finish(); }

void Uploads::finish() {
  {
    const std::scoped_lock lock(mutex_);
    ends_ = true;
  }
  wake_.notify_all();
  if (thread_.joinable()) thread_.join();
}

std::vector<Uploads::Entry> Uploads::list() const {
  std::vector<Entry> entries;
  for (const auto& upload : store_.uploads()) entries.push_back({upload.id, upload.name});
  return entries;
}

void Uploads::keep(Entry entry, SharedBytes bytes, std::vector<std::string> dropped,
                   std::function<void(Result<void>)> done) {
  {
    const std::scoped_lock lock(mutex_);
    jobs_.emplace_back([this, entry = std::move(entry), bytes = std::move(bytes), dropped = std::move(dropped),
                        done = std::move(done)] {
      done(store_.keepUpload({entry.id, entry.name}, bytes, dropped));
    });
  }
  wake_.notify_all();
}

Result<SharedBytes> Uploads::read(const std::string& id) { return store_.readUpload(id); }

void Uploads::work() {
  std::unique_lock lock(mutex_);
  for (;;) {
    wake_.wait(lock, [&] { return ends_ || !jobs_.empty(); });
    if (jobs_.empty()) return;
    const auto job = std::move(jobs_.front());
    jobs_.pop_front();
    lock.unlock();
    job();
    lock.lock();
  }
}

}  // namespace radiosity::state
