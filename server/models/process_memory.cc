#include "server/models/process_memory.h"

#include <malloc.h>

namespace deform::server {
namespace {

// Twice the largest chunk of a frame.
constexpr int kLargeBlock = 2 << 20;

}  // namespace

// Setting a threshold ends its growing by itself.
void ReturnLargeBlocks() { mallopt(M_MMAP_THRESHOLD, kLargeBlock); }

void ReturnFreedMemory() { malloc_trim(0); }

}  // namespace deform::server
