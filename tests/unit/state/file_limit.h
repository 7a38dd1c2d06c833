// A disk that is full, without filling one.
#pragma once

#include <sys/resource.h>

#include <csignal>

namespace radiosity::test {

/// Files of this process may not grow beyond so much, as on a full disk.
class FileLimit {
 public:
  explicit FileLimit(rlim_t bytes) {
    (void)getrlimit(RLIMIT_FSIZE, &before_);
    before_handler_ = std::signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{bytes, before_.rlim_max};
    (void)setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileLimit() {
    (void)setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, before_handler_);
  }
  FileLimit(const FileLimit&) = delete;
  FileLimit& operator=(const FileLimit&) = delete;

 private:
  rlimit before_{};
  void (*before_handler_)(int) = nullptr;
};

}  // namespace radiosity::test
