// HUETRACK_CLONES before a function: one copy per instruction set, chosen when the program is loaded. The results are
// the same bits in all of them (-ffp-contract=off). The sanitizers' run-time is not up yet when that choice is made, so
// their builds have the plain copy only.
#pragma once

#ifdef __has_feature  // clang's way to say what GCC says by __SANITIZE_ADDRESS__ and __SANITIZE_THREAD__
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define HUETRACK_NO_AVX2
#endif
#endif
#if defined(__x86_64__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__) && !defined(HUETRACK_NO_AVX2)
// Before functions of the same name: what is written by hand for AVX-512 or AVX2, and what is for every other machine.
#define HUETRACK_AVX2_VERSION __attribute__((target("avx2")))
#define HUETRACK_DEFAULT_VERSION __attribute__((target("default")))
#ifdef HUETRACK_NO_AVX512
#define HUETRACK_CLONES __attribute__((target_clones("avx2", "default")))
#else
#define HUETRACK_CLONES __attribute__((target_clones("avx512f", "avx2", "default")))
#define HUETRACK_AVX512_VERSION __attribute__((target("avx512f")))
#endif
#else
#define HUETRACK_CLONES
#define HUETRACK_DEFAULT_VERSION
#endif

// HUETRACK_INDEPENDENT before a loop: its iterations share nothing, whatever the pointers look like.
#ifdef __clang__
#define HUETRACK_INDEPENDENT _Pragma("clang loop vectorize(assume_safety)")
#else
#define HUETRACK_INDEPENDENT _Pragma("GCC ivdep")
#endif
