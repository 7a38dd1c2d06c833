// main() of the Google Benchmark programs. Each is its own worker process too.
#include <benchmark/benchmark.h>

#include <cstring>

#include "server/gpu/workers/gpu_transport.h"

int main(int argc, char** argv) {
  if (argc > 1 && std::strcmp(argv[1], "--worker") == 0) return radiosity::gpu::workerMain(argc - 2, argv + 2);
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
