// Normals of vertices, for who shades a frame: two bytes each.
//
// Bit by bit: a unit normal (x, y, z) is projected onto the octahedron
// |x| + |y| + |z| = 1, whose lower half is folded outwards over the upper:
//
//   p = (x, y) / (|x| + |y| + |z|)
//   if z < 0:  p = ((1 - |p_y|) sign(p_x), (1 - |p_x|) sign(p_y)),
//              where sign is 1 for 0 and -0
//
// and sent as two int8, round(127 p_x) and round(127 p_y); -128 stands for
// -127. The reverse, for whole numbers i and j:
//
//   p = (i, j) / 127, z = 1 - |p_x| - |p_y|
//   if z < 0:  p as above;   n = (p_x, p_y, z) / its length
//
// A normal is off by at most 0.017 (1 degree); the six axes are exact.
// Source: Meyer et al., "On Floating-Point Normal Vectors", EGSR 2010; as
// compared in Cigolle et al., JCGT 3(2), 2014.
#pragma once

#include <cstdint>
#include <span>

#include "absl/status/status.h"
#include "core/mesh/types.h"

namespace deform {

inline constexpr int64_t kNormalBytes = 2;

// Unit normals of N vertices at `positions` (N x 3), N x 3: of the faces
// (F x 3) around each, weighted by their areas. Faces without area add nothing;
// where nothing is left, as for a vertex without faces, it is (0, 0, 1). The
// plain way; see vertex_fans.h.
void ComputeNormals(std::span<const float> positions, const Faces& faces,
                    std::span<float> normals);

// A direction of any length to two bytes. Any numbers give bytes; (0, 0, 0) and
// what is not finite those of (0, 0, 1).
void EncodeNormal(const Vec3& direction, uint8_t* bytes);
// N x 3 to 2 N bytes, likewise.
void EncodeNormals(std::span<const float> normals, std::span<uint8_t> bytes);

// InvalidArgument (BAD_FRAME) unless there are 2 bytes for each of N normals.
absl::Status DecodeNormals(std::span<const uint8_t> bytes,
                           std::span<float> normals);

}  // namespace deform
