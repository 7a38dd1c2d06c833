// Destroys what is of no use any more on a thread of its own: a scene of millions of patches, or a document of hundreds
// of thousands of nodes, takes hundreds of milliseconds to go, which nobody is to wait for. Belongs to one thread. Its
// end waits for what it has.
#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <new>
#include <thread>
#include <utility>
#include <vector>

namespace radiosity::engine {

class Disposer {
 public:
  Disposer() = default;
  ~Disposer();
  Disposer(const Disposer&) = delete;
  Disposer& operator=(const Disposer&) = delete;

  /// Lets go of it; null does nothing. Where there is no thread, or no memory for it, that is done here.
  void dispose(std::shared_ptr<const void> of_no_use) noexcept;
  template <typename T>
  void dispose(std::unique_ptr<T> of_no_use) noexcept {
    try {
      dispose(std::shared_ptr<const void>(std::move(of_no_use)));
    } catch (const std::bad_alloc&) {  // it goes here
    }
  }
  /// Waits until all of it is gone, since its memory is needed. False: there was nothing.
  bool drain();

 private:
  void run();

  std::mutex mutex_;
  std::condition_variable wake_, idle_;
  std::vector<std::shared_ptr<const void>> waiting_;
  bool ends_ = false, is_busy_ = false;
  std::thread thread_;  ///< begins with the first
};

}  // namespace radiosity::engine
