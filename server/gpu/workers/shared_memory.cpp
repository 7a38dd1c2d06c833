#include "server/gpu/workers/shared_memory.h"

#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace radiosity::gpu {

void FileDescriptor::reset() {
  if (fd_ >= 0) close(fd_);
  fd_ = -1;
}

Result<SharedMemory> SharedMemory::create(const char* name, std::size_t bytes) {
  FileDescriptor fd(memfd_create(name, MFD_CLOEXEC));
  if (fd.get() < 0 || ftruncate(fd.get(), static_cast<off_t>(std::max<std::size_t>(bytes, 1))) != 0) {
    return fail(ErrorCode::kUnavailable, std::string("cannot make shared memory: ") + std::strerror(errno), name);
  }
  return map(std::move(fd));
}

Result<SharedMemory> SharedMemory::map(FileDescriptor fd) {
  struct stat status {};
  if (fstat(fd.get(), &status) != 0 || status.st_size <= 0) {
    return fail(ErrorCode::kUnavailable, "shared memory has no size");
  }
  const auto bytes = static_cast<std::size_t>(status.st_size);
  void* data = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd.get(), 0);
  if (data == MAP_FAILED) {
    return fail(ErrorCode::kUnavailable, std::string("cannot map shared memory: ") + std::strerror(errno));
  }
  SharedMemory memory;
  memory.fd_ = std::move(fd);
  memory.data_ = static_cast<std::byte*>(data);
  memory.bytes_ = bytes;
  return memory;
}

SharedMemory::~SharedMemory() {
  if (data_ != nullptr) munmap(data_, bytes_);
}

}  // namespace radiosity::gpu
