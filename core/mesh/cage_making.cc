// A surface around the model at the margin r, decimated as long as it keeps
// clear of the model.
//
// A surface that never touches the model keeps it on the same side, which the
// winding number confirms in the end. In 2D the same surface, sliced near the
// plane of the model, gives loops.
#include "core/mesh/cage_making.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/mesh/distance_grid.h"
#include "core/mesh/offset_surface.h"
#include "core/mesh/outline.h"
#include "core/mesh/self_intersection.h"
#include "core/mesh/topology.h"
#include "core/mesh/triangle.h"
#include "core/mesh/winding.h"

namespace deform {
namespace {

// In margins. At the level of the slice lies no node.
constexpr double kSpacing = 0.5;
constexpr double kSliceLevel = 0.17;
constexpr double kPadding = 2.5;
constexpr double kClearance = 0.35;

// Bounds on the shape of faces. Between long sides nothing can bend, so they
// are kept below this many times the side of an even triangulation.
constexpr double kLongestSide = 2;
constexpr double kMinRoundness = 0.2;

constexpr int kDefaultTriangles = 200;
constexpr int kDefaultEdges = 40;

absl::Status CheckOptions(const Mesh& model, const CageMakingOptions& options) {
  if (options.target_faces < 8 || options.target_faces > 20000) {
    return InvalidInput(
        "INVALID_OPTION", "target_faces",
        absl::StrCat("the number of faces to aim at must be between 8 and "
                     "20000, not ",
                     options.target_faces));
  }
  if (!(options.margin >= 0.01 && options.margin <= 1)) {
    return InvalidInput("INVALID_OPTION", "margin",
                        absl::StrCat("the margin must be between 0.01 and 1 "
                                     "diagonals of the model, not ",
                                     options.margin));
  }
  if (!(model.box().diagonal() > 0)) {
    return InvalidInput("MODEL_WITHOUT_EXTENT", "",
                        "all points of the model are at one place");
  }
  return absl::OkStatus();
}

double LongestSide(const Vec3& a, const Vec3& b, const Vec3& c) {
  return std::max({(b - a).norm(), (c - b).norm(), (a - c).norm()});
}

// Whether the triangle keeps `clearance`: distances change by at most the way
// gone, so one sample in the middle vouches for all points nearer to it than
// what it has to spare; where that is not enough, quarters are asked. Pieces
// smaller than a sixth of the margin are taken at their sample.
bool KeepsClear(const DistanceGrid& grid, double clearance, const Vec3& a,
                const Vec3& b, const Vec3& c) {
  const Vec3 center = (a + b + c) / 3;
  const double spare = grid.At(center) - clearance;
  if (!(spare >= 0)) return false;
  const double radius =
      std::max({(a - center).norm(), (b - center).norm(), (c - center).norm()});
  if (radius <= std::max(spare, grid.spacing() / 3)) return true;
  const Vec3 ab = (a + b) / 2;
  const Vec3 bc = (b + c) / 2;
  const Vec3 ca = (c + a) / 2;
  return KeepsClear(grid, clearance, ab, bc, ca) &&
         KeepsClear(grid, clearance, a, ab, ca) &&
         KeepsClear(grid, clearance, ab, b, bc) &&
         KeepsClear(grid, clearance, ca, bc, c);
}

// Height over longest side, in parts of what an equilateral triangle has.
double Roundness(const Vec3& a, const Vec3& b, const Vec3& c) {
  const double longest = LongestSide(a, b, c);
  return AreaVector(a, b, c).norm() / (longest * longest) / (std::sqrt(3) / 2);
}

// Side of an equilateral triangle with one of `count` parts of the area.
double MeanSide(const TriangleSurface& surface, int count) {
  double area = 0;
  for (const auto& face : surface.faces.rowwise()) {
    area += AreaVector(surface.positions.row(face[0]),
                       surface.positions.row(face[1]),
                       surface.positions.row(face[2]))
                .norm() /
            2;
  }
  return std::sqrt(4 / std::sqrt(3) * area / count);
}

double MeanSide(const Outline& outline, int count) {
  double length = 0;
  for (const auto& edge : outline.edges.rowwise()) {
    length += (outline.positions.row(edge[1]) - outline.positions.row(edge[0]))
                  .norm();
  }
  return length / count;
}

// Moves each vertex half way to the mean of its neighbours, a few times:
// marching leaves thin triangles that decimation could not get rid of.
void Relax(TriangleSurface& surface) {
  constexpr int kPasses = 5;
  for (int pass = 0; pass < kPasses; ++pass) {
    Positions sums = Positions::Zero(surface.positions.rows(), 3);
    Eigen::VectorXd counts = Eigen::VectorXd::Zero(surface.positions.rows());
    for (const auto& face : surface.faces.rowwise()) {
      for (int k = 0; k < 3; ++k) {
        // Every edge is seen from both of its faces, once each way.
        sums.row(face[k]) += surface.positions.row(face[(k + 1) % 3]);
        counts[face[k]] += 1;
      }
    }
    const Positions means = (sums.array().colwise() / counts.array()).matrix();
    surface.positions = 0.5 * (surface.positions + means);
  }
}

// The model in a box of diagonal 1 around the origin.
Positions Normalized(const Mesh& model) {
  return (model.positions().rowwise() - model.box().center().transpose()) /
         model.box().diagonal();
}

// Positions and faces of a cage.
struct Candidate {
  Positions vertices;
  Faces faces;
};

bool EnclosesAll(const Candidate& cage, const Positions& positions) {
  for (const auto& row : positions.rowwise()) {
    const double winding =
        WindingNumber(cage.vertices, cage.faces, row.transpose());
    if (!(std::abs(winding - 1) < 0.5)) return false;
  }
  return true;
}

class Maker {
 public:
  Maker(const Mesh& model, double margin)
      : positions_(Normalized(model)),
        margin_(margin),
        grid_(positions_, model.faces(), kSpacing * margin, kPadding * margin),
        offset_(OffsetSurface(grid_, margin)) {
    Relax(offset_);
  }

  // Nullopt if it runs through itself or does not hold the model.
  std::optional<Candidate> Make(int dimension, int target_faces) const {
    Candidate cage =
        dimension == 2 ? MakeLoops(target_faces) : MakeSurface(target_faces);
    if (FindSelfIntersection(cage.vertices, cage.faces)) return std::nullopt;
    if (!EnclosesAll(cage, positions_)) return std::nullopt;
    return cage;
  }

 private:
  Candidate MakeSurface(int target_faces) const {
    const double longest = kLongestSide * MeanSide(offset_, target_faces);
    TriangleSurface surface =
        Decimate(offset_, target_faces,
                 [&](const Vec3& a, const Vec3& b, const Vec3& c) {
                   return LongestSide(a, b, c) <= longest &&
                          Roundness(a, b, c) >= kMinRoundness &&
                          KeepsClear(grid_, kClearance * margin_, a, b, c);
                 });
    return {std::move(surface.positions), std::move(surface.faces)};
  }

  Candidate MakeLoops(int target_edges) const {
    const Outline outline = Slice(offset_, kSliceLevel * margin_);
    const double longest = kLongestSide * MeanSide(outline, target_edges);
    Outline loops = Simplify(
        outline, target_edges,
        [&](const Vec3& before, const Vec3& gone, const Vec3& next) {
          return (next - before).norm() <= longest &&
                 KeepsClear(grid_, kClearance * margin_, before, gone, next);
        });
    return {std::move(loops.positions), std::move(loops.edges)};
  }

  Positions positions_;
  double margin_;
  DistanceGrid grid_;
  TriangleSurface offset_;
};

// The one with the fewest faces of several attempts; the first one that comes
// near the target ends them.
std::optional<Candidate> FindCage(const Mesh& model,
                                  const CageMakingOptions& options) {
  std::optional<Candidate> best;
  for (const double widening : {1.0, 1.4, 2.0, 3.0}) {
    const Maker maker(model, widening * options.margin);
    for (const double more : {1.0, 1.5, 2.0}) {
      const int target = static_cast<int>(more * options.target_faces);
      auto cage = maker.Make(model.dimension(), target);
      if (!cage) continue;
      if (!best || cage->faces.rows() < best->faces.rows()) {
        best = std::move(cage);
      }
      if (best->faces.rows() <= 2 * options.target_faces) return best;
      break;
    }
  }
  return best;
}

}  // namespace

absl::StatusOr<Cage> MakeCage(const Mesh& model,
                              const CageMakingOptions& given) {
  CageMakingOptions options = given;
  const bool planar = model.dimension() == 2;
  if (options.target_faces == 0) {
    options.target_faces = planar ? kDefaultEdges : kDefaultTriangles;
  }
  DEFORM_RETURN_IF_ERROR(CheckOptions(model, options));
  std::optional<Candidate> cage = FindCage(model, options);
  if (!cage) {
    return MakeError(absl::StatusCode::kFailedPrecondition,
                     "no cage was found that encloses the model without "
                     "running through itself; more faces or another margin may "
                     "help",
                     {.reason = "NO_CAGE_FOUND"});
  }
  Positions vertices = cage->vertices * model.box().diagonal();
  vertices.rowwise() += model.box().center().transpose();
  return Cage::Create(model.dimension(), std::move(vertices),
                      std::move(cage->faces));
}

}  // namespace deform
