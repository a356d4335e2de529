// Source: [L08] Lipman, Levin, Cohen-Or, "Green Coordinates", ACM TOG 27(3),
//   2008: Eq. 9 (columns), Eq. 13 and 14 (stretch), section 4.2 (extension).
// Departs: Eq. 14 in the orthonormal frame of the rest face; as printed it
//   loses eps x aspect^2 of thin faces.
#include "core/deform/columns.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Geometry>
#include <Eigen/LU>

namespace deform {
namespace {

Vec3 Row(const Positions& rows, int64_t i) { return rows.row(i).transpose(); }

// Outward of a directed edge with the domain on its left.
Vec3 Right(const Vec3& t) { return {t.y(), -t.x(), 0}; }

// `v` divided by its length, or zero.
Vec3 Unit(const Vec3& v) {
  // Squares of very long and very short ones leave the range of double.
  const double square = v.squaredNorm();
  const double length =
      square > 1e-200 && square < 1e200 ? std::sqrt(square) : v.stableNorm();
  return length > 0 ? Vec3(v / length) : Vec3(Vec3::Zero());
}

FaceFrame EdgeFrame(const Positions& vertices, const Faces& faces, int64_t f) {
  FaceFrame frame{.corner = {faces(f, 0), faces(f, 1), faces(f, 1)}};
  const Vec3 t = Row(vertices, faces(f, 1)) - Row(vertices, faces(f, 0));
  frame.normal = Unit(Right(t));
  frame.inverse_u2 = 1 / t.squaredNorm();
  return frame;
}

FaceFrame TriangleFrame(const Positions& vertices, const Faces& faces,
                        int64_t f) {
  // Corners turned so that the shortest edge comes first.
  int first = 0;
  double shortest = INFINITY;
  for (int k = 0; k < 3; ++k) {
    const double length =
        (Row(vertices, faces(f, (k + 1) % 3)) - Row(vertices, faces(f, k)))
            .squaredNorm();
    if (length < shortest) {
      shortest = length;
      first = k;
    }
  }
  FaceFrame frame{.corner = {faces(f, first), faces(f, (first + 1) % 3),
                             faces(f, (first + 2) % 3)}};
  const Vec3 origin = Row(vertices, frame.corner[0]);
  const Vec3 u = Row(vertices, frame.corner[1]) - origin;
  const Vec3 v = Row(vertices, frame.corner[2]) - origin;
  const Vec3 cross = u.cross(v);
  const double u2 = u.squaredNorm();
  frame.normal = Unit(cross);
  frame.inverse_u2 = 1 / u2;
  frame.inverse_w2 = u2 / cross.squaredNorm();
  frame.shear = u.dot(v) / u2;
  return frame;
}

// u' and v' of a posed triangle.
struct PosedEdges {
  Vec3 u;
  Vec3 v;
};

PosedEdges EdgesOf(const Positions& vertices, const FaceFrame& face) {
  const Vec3 origin = Row(vertices, face.corner[0]);
  return {Row(vertices, face.corner[1]) - origin,
          Row(vertices, face.corner[2]) - origin};
}

// The linear map of a face: edges to posed edges, normal to scaled normal.
Eigen::Matrix3d FaceMap(const Cage& cage, int64_t face, const Columns& rest,
                        const Columns& columns) {
  const auto basis = [&](const Columns& c) {
    const auto corner = [&](int k) { return Row(c, cage.faces()(face, k)); };
    Eigen::Matrix3d b = Eigen::Matrix3d::Identity();
    b.col(0) = corner(1) - corner(0);
    if (cage.dimension() == 3) b.col(1) = corner(2) - corner(0);
    b.col(cage.dimension() - 1) = Row(c, cage.vertex_count() + face);
    return b;
  };
  return basis(columns) * basis(rest).inverse();
}

double FaceMismatch(const Cage& cage, int64_t exit, int64_t crossed,
                    const Columns& rest, const Columns& columns) {
  const Eigen::Matrix3d map = FaceMap(cage, exit, rest, columns);
  const double linear = (FaceMap(cage, crossed, rest, columns) - map).norm();
  const int32_t origin = cage.faces()(exit, 0);
  double distance = 0;
  for (int k = 0; k < cage.dimension(); ++k) {
    const int32_t v = cage.faces()(crossed, k);
    const Vec3 carried =
        map * (Row(rest, v) - Row(rest, origin)) + Row(columns, origin);
    distance = std::max(distance, (Row(columns, v) - carried).norm());
  }
  const double stretch = Row(columns, cage.vertex_count() + exit).norm();
  // A collapsed exit face has no similarity to compare with: any deviation is
  // total.
  constexpr double kCollapsed = 1e-12;
  return std::max(linear, distance / cage.diagonal()) /
         std::max(stretch, kCollapsed);
}

}  // namespace

PosedColumns::PosedColumns(const Rig& rig, bool uses_normals)
    : dimension_(DimensionOf(rig)), vertex_count_(RestVertices(rig).rows()) {
  const Positions& vertices = RestVertices(rig);
  const Cage* cage = std::get_if<Cage>(&rig);
  first_.assign(vertex_count_ + 1, 0);
  if (cage != nullptr && uses_normals) {
    const Faces& faces = cage->faces();
    for (int64_t f = 0; f < faces.rows(); ++f) {
      faces_.push_back(dimension_ == 2 ? EdgeFrame(vertices, faces, f)
                                       : TriangleFrame(vertices, faces, f));
      for (int k = 0; k < dimension_; ++k) ++first_[faces(f, k) + 1];
    }
    for (int64_t v = 0; v < vertex_count_; ++v) first_[v + 1] += first_[v];
    incident_.resize(first_.back());
    std::vector<int32_t> next(first_.begin(), first_.end() - 1);
    for (int64_t f = 0; f < faces.rows(); ++f) {
      for (int k = 0; k < dimension_; ++k) {
        incident_[next[faces(f, k)]++] = static_cast<int32_t>(f);
      }
    }
  }
  rest_.resize(vertex_count_ + static_cast<int64_t>(faces_.size()), 3);
  rest_.topRows(vertex_count_) = vertices;
  for (size_t f = 0; f < faces_.size(); ++f) {
    rest_.row(vertex_count_ + static_cast<int64_t>(f)) =
        faces_[f].normal.transpose();
  }
}

double PosedColumns::Stretch(const Positions& vertices, int64_t face) const {
  const FaceFrame& frame = faces_[face];
  const auto [u, v] = EdgesOf(vertices, frame);
  const double along = u.squaredNorm() * frame.inverse_u2;
  if (dimension_ == 2) return std::sqrt(along);
  const double across = (v - frame.shear * u).squaredNorm() * frame.inverse_w2;
  return std::sqrt(0.5 * (along + across));
}

Vec3 PosedColumns::ScaledNormal(const Pose& pose, int64_t face) const {
  const FaceFrame& frame = faces_[face];
  const auto [u, v] = EdgesOf(pose.vertices, frame);
  const double b = pose.stretch_blend;
  Vec3 direction = Unit(dimension_ == 2 ? Right(u) : Vec3(u.cross(v)));
  if (direction.isZero(0)) {
    const Vec3 left = Unit(u.squaredNorm() > v.squaredNorm() ? u : v);
    direction = Unit(frame.normal - left.dot(frame.normal) * left);
  }
  return (b * Stretch(pose.vertices, face) + (1 - b)) * direction;
}

void PosedColumns::UpdateAll(const Pose& pose, Columns& columns) const {
  columns.resize(count(), 3);
  columns.topRows(vertex_count_) = pose.vertices;
  for (int64_t c = vertex_count_; c < count(); ++c) {
    columns.row(c) = ScaledNormal(pose, c - vertex_count_).transpose();
  }
}

std::vector<int32_t> PosedColumns::Update(const Pose& pose,
                                          std::span<const int32_t> moved,
                                          Columns& columns) const {
  std::vector<int32_t> changed(moved.begin(), moved.end());
  for (const int32_t v : moved) {
    columns.row(v) = pose.vertices.row(v);
    for (int32_t i = first_[v]; i < first_[v + 1]; ++i) {
      changed.push_back(static_cast<int32_t>(vertex_count_) + incident_[i]);
    }
  }
  std::sort(changed.begin(), changed.end());
  changed.erase(std::unique(changed.begin(), changed.end()), changed.end());
  for (const int32_t c : changed) {
    if (c < vertex_count_) continue;
    columns.row(c) = ScaledNormal(pose, c - vertex_count_).transpose();
  }
  return changed;
}

double ExitMismatch(const Cage& cage, const std::vector<ExitPart>& parts,
                    const PosedColumns& posed, const Columns& columns) {
  double mismatch = 0;
  for (const ExitPart& part : parts) {
    for (const int32_t face : part.crossed_faces) {
      mismatch = std::max(mismatch, FaceMismatch(cage, part.exit_face, face,
                                                 posed.rest(), columns));
    }
  }
  return mismatch;
}

}  // namespace deform
