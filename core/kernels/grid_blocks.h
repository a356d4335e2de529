// Blocks of integers on a grid: how one is predicted from another, and how what
// is left is packed.
//
// Pointers and counts only; dispatched at run time and judged by the plain
// version, which gives the same integers. All arithmetic on places is modulo
// 2^32 and shifts to the right keep the sign, so that any input has one result
// on every machine.
#pragma once

#include <cstdint>

namespace deform {

// Points of a block, and those of them that are packed with the same number of
// bits.
inline constexpr int64_t kGridBlock = 256;
inline constexpr int64_t kGridGroup = 64;

// Rounds x(i) * per_step to the nearest integers, ties to even, in double, for
// one coordinate of a block. False if one is larger than `limit`, which is
// below 2^31, or none at all; its integer then is any.
bool RoundToGrid(const float* x, double per_step, double limit, int32_t* grid);
// x(i) = grid(i) * step, in double, rounded to float.
void LeaveGrid(const int32_t* grid, double step, float* x);

// One coordinate of a block as a linear function of where the block was in the
// reference, a: with m = a(0), the place of the block's first point,
//
//   q(i) ~ a_d(i) + offset +
//          ((sum over k of gradient[k] ((a_k(i) - m_k) >> shift) + half)
//           >> fraction)
//
// with half = 2^fraction / 2, rounded down.
struct GridPrediction {
  int32_t shift = 0;  // Of the block; 0 to 31.
  int32_t offset = 0;
  int32_t gradient[3] = {};
  int32_t fraction = 0;  // 0 to 31.
};

// Three coordinates of a block, kGridBlock numbers each.
struct GridBlock {
  const int32_t* of[3];
};

// What a block's displacements say about how they depend on place.
struct GridExtent {
  // Largest magnitude of a_k(i) - m_k, as the OR of all of them, negative ones
  // inverted: tells the bits that are needed.
  uint32_t place[3];
  // The same of e_d(i) - e_d(0), with e = q - a.
  uint32_t motion[3];
};
GridExtent MeasureExtent(const GridBlock& reference, const GridBlock& grid);

// Sums over the block's points of U_k = (a_k - m_k) >> place_shift and E_d =
// (e_d - e_d(0)) >> motion_shift, which have at most 11 bits and a sign: exact.
struct GridMoments {
  int32_t places[3];              // U_k
  int32_t motions[3];             // E_d
  int32_t place_products[3][3];   // U_k U_l, where k <= l
  int32_t motion_products[3][3];  // [d][k]: E_d U_k
};
GridMoments SumMoments(const GridBlock& reference, const GridBlock& grid,
                       int place_shift, const int (&motion_shift)[3]);

// What coordinate d of `grid` differs from its prediction by, folded so that
// small magnitudes are small: 0, -1, 1, -2, ... become 0, 1, 2, 3, ...
void FoldResiduals(const GridBlock& reference, int d, const int32_t* grid,
                   const GridPrediction& prediction, uint32_t* folded);
// The reverse. `grid` must not be one of the reference.
void AddResiduals(const GridBlock& reference, int d, const uint32_t* folded,
                  const GridPrediction& prediction, int32_t* grid);

// Writes the lowest `bits` bits (0 to 32) of kGridGroup values as planes of 8
// bytes, lowest first: bit i of plane k is bit k of value i, counted from the
// lowest bit of a plane's first byte on.
void PackBits(const uint32_t* values, int bits, uint8_t* out);
// The reverse; higher bits of the values are 0.
void UnpackBits(const uint8_t* planes, int bits, uint32_t* values);

// The judges.
bool RoundToGridPlain(const float* x, double per_step, double limit,
                      int32_t* grid);
void LeaveGridPlain(const int32_t* grid, double step, float* x);
GridExtent MeasureExtentPlain(const GridBlock& reference,
                              const GridBlock& grid);
GridMoments SumMomentsPlain(const GridBlock& reference, const GridBlock& grid,
                            int place_shift, const int (&motion_shift)[3]);
void FoldResidualsPlain(const GridBlock& reference, int d, const int32_t* grid,
                        const GridPrediction& prediction, uint32_t* folded);
void AddResidualsPlain(const GridBlock& reference, int d,
                       const uint32_t* folded, const GridPrediction& prediction,
                       int32_t* grid);
void PackBitsPlain(const uint32_t* values, int bits, uint8_t* out);
void UnpackBitsPlain(const uint8_t* planes, int bits, uint32_t* values);

}  // namespace deform
