#include "tests/fuzz/mesh_checks.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  deform::CheckMeshFormat("ply", data, size);
  return 0;
}
