// What holds for any bytes given to a mesh format.
#pragma once

#include <cstddef>
#include <cstdint>

namespace deform {

// Parses the bytes and ends the run unless they are refused, or give a mesh
// that is sound and writes back: unmoved to the same bytes, moved to a file
// that reads as what was written.
void CheckMeshFormat(const char* format, const uint8_t* data, size_t size);

}  // namespace deform
