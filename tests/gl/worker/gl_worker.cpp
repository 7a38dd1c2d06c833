// A program that is nothing but a worker, for the tests of the worker transport. Built as gl_worker.
#include <cstring>

#include "server/gpu/workers/gpu_transport.h"

int main(int argc, char** argv) {
  if (argc < 2 || std::strcmp(argv[1], "--worker") != 0) return 2;
  return radiosity::gpu::workerMain(argc - 2, argv + 2);
}
