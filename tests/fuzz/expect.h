// Promises that a fuzz target holds its decoder to.
#pragma once

#include <cstdio>
#include <cstdlib>

// Ends the run, whatever the build type, if `condition` is false.
#define FUZZ_EXPECT(condition)                                             \
  do {                                                                     \
    if (!(condition)) {                                                    \
      std::fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition); \
      std::abort();                                                        \
    }                                                                      \
  } while (false)
