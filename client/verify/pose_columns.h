// What weights give in double precision, as a client computes it to check a
// server.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "client/cpp/arrays.h"
#include "client/verify/golden_case.h"
#include "core/deform/columns.h"

namespace deform {

// The columns of a case's rig at rest and in each deformation: V vertices, then
// F scaled normals for Green coordinates. Immutable.
class CaseColumns {
 public:
  // The errors of Cage::Create() and Handles::Create().
  static absl::StatusOr<CaseColumns> Create(const GoldenCase& golden);

  // C: vertices and normals.
  int64_t count() const { return rest_.rows(); }

  // s_b = b s + (1 - b) per face; none without normals.
  const std::vector<double>& stretch(size_t deformation) const {
    return stretch_[deformation];
  }

  // eta + sum phi (v' - v) + sum psi (s n' - n). `weights` has C entries.
  Vec3 Deform(const Vec3& point, const std::vector<double>& weights,
              size_t deformation) const;

  // sum phi v + sum psi n - eta, summed about the point, so that an offset
  // costs no digits.
  Vec3 ReproductionError(const Vec3& point,
                         const std::vector<double>& weights) const;

 private:
  CaseColumns() = default;

  int64_t vertex_count_ = 0;
  Columns rest_;
  std::vector<Columns> posed_;
  std::vector<std::vector<double>> stretch_;
};

}  // namespace deform
