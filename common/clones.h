// Functions that the compiler makes twice, for processors with and without 256-bit vectors.
#pragma once

/// Before the definition of a function whose loops vectorise: one clone is for processors with AVX2, and which one is
/// called is decided as the program is loaded. No fused multiply-add in either, so both give the same bits.
///
/// Such a function must not throw, so it gets the memory that it needs: GCC 12 calls it as one that never does, and an
/// exception out of it ends the program.
///
/// The thread sanitizer has one alone: GCC instruments what decides as well, which runs before the sanitizer does, and
/// the program ends with a segmentation fault before main().
/// So has Clang, which builds for static checks and fuzzers: its sanitizers instrument that as well.
#if defined(__SANITIZE_THREAD__) || defined(__clang__)
#define RADIOSITY_CLONES
#else
#define RADIOSITY_CLONES __attribute__((target_clones("avx2", "default")))
#endif
