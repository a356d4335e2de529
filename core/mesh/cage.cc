#include "core/mesh/cage.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/mesh/closedness.h"
#include "core/mesh/self_intersection.h"
#include "core/mesh/triangle.h"
#include "core/mesh/winding.h"

namespace deform {
namespace {

constexpr char kVerticesField[] = "rig.cage.vertices";
constexpr char kCornersField[] = "rig.cage.corners";

// Products of three lengths below this would not be normal numbers.
constexpr double kMinLength = 1e-100;
// Each pair of faces costs about 50 ns; cages of up to 2000 faces are checked
// face by face, larger ones at evenly spread faces.
constexpr int64_t kMaxFacePairs = 4'000'000;

absl::Status CheckShape(int dimension, const Positions& vertices,
                        const Faces& faces) {
  if (dimension != 2 && dimension != 3) {
    return InvalidInput(
        "BAD_DIMENSION", "rig.cage.dimension",
        absl::StrCat("dimension must be 2 or 3, not ", dimension));
  }
  if (vertices.rows() == 0 || faces.rows() == 0) {
    return InvalidInput("EMPTY_CAGE", "rig.cage",
                        vertices.rows() == 0 ? "the cage has no vertices"
                                             : "the cage has no faces");
  }
  if (faces.cols() != dimension) {
    return InvalidInput(
        "BAD_DIMENSION", kCornersField,
        absl::StrCat("faces of a ", dimension, "D cage have ", dimension,
                     " corners, not ", faces.cols()));
  }
  return absl::OkStatus();
}

absl::Status CheckPlanar(const Positions& vertices) {
  for (int64_t i = 0; i < vertices.rows(); ++i) {
    if (vertices(i, 2) != 0) {
      return InvalidInput("NOT_PLANAR", kVerticesField,
                          absl::StrCat("vertex ", i, " of a 2D cage has z = ",
                                       vertices(i, 2), ", not 0"));
    }
  }
  return absl::OkStatus();
}

// What is wrong with face f; empty if nothing is. A face has a normal only if
// it is thicker than the rounding of its own coordinates, and its angles tell
// it from a line: at a sine of 1e-13 the normal has three digits left. Slivers
// of aspect 1e9 pass.
std::string Degeneracy(const Positions& vertices, const Faces& faces,
                       int64_t f) {
  const int corners = static_cast<int>(faces.cols());
  double longest = 0;
  double shortest = std::numeric_limits<double>::infinity();
  double largest_coordinate = 0;
  for (int k = 0; k < corners; ++k) {
    const int32_t a = faces(f, k);
    const int32_t b = faces(f, (k + 1) % corners);
    if (a == b) return absl::StrCat("has vertex ", a, " as two of its corners");
    const double length = (vertices.row(b) - vertices.row(a)).stableNorm();
    if (length == 0) {
      return absl::StrCat("has no ", corners == 2 ? "length" : "area",
                          ": its vertices ", a, " and ", b, " coincide");
    }
    longest = std::max(longest, length);
    shortest = std::min(shortest, length);
    largest_coordinate =
        std::max(largest_coordinate, vertices.row(a).cwiseAbs().maxCoeff());
  }
  const double rounding =
      4 * std::numeric_limits<double>::epsilon() * largest_coordinate;
  if (!(shortest > std::max(rounding, kMinLength))) {
    return absl::StrCat("has a side of length ", shortest,
                        ", too short to tell where it points");
  }
  if (corners == 2) return {};
  const double height =
      AreaVector(vertices.row(faces(f, 0)), vertices.row(faces(f, 1)),
                 vertices.row(faces(f, 2)))
          .stableNorm() /
      longest;
  if (height > std::max(rounding, 1e-13 * shortest)) return {};
  return "has no area: its corners lie on one line";
}

absl::Status CheckFaces(const Positions& vertices, const Faces& faces) {
  for (int64_t f = 0; f < faces.rows(); ++f) {
    const std::string degeneracy = Degeneracy(vertices, faces, f);
    if (!degeneracy.empty()) {
      return InvalidInput("DEGENERATE_FACE", kCornersField,
                          absl::StrCat("face ", f, " ", degeneracy));
    }
  }
  return absl::OkStatus();
}

Vec3 Centroid(const Positions& vertices, const Faces& faces, int64_t f) {
  Vec3 sum = Vec3::Zero();
  for (int k = 0; k < faces.cols(); ++k) {
    sum += vertices.row(faces(f, k)).transpose();
  }
  return sum / static_cast<double>(faces.cols());
}

// Whether nothing but rounding is left of the volume (2D: area), as of a face
// and its mirror image.
bool EnclosesNothing(const Positions& vertices, const Faces& faces) {
  const Vec3 origin = vertices.row(faces(0, 0));
  double sum = 0;
  double magnitude = 0;
  for (int64_t f = 0; f < faces.rows(); ++f) {
    const Vec3 a = vertices.row(faces(f, 0)).transpose() - origin;
    const Vec3 b = vertices.row(faces(f, 1)).transpose() - origin;
    const Vec3 c = faces.cols() == 2
                       ? Vec3(0, 0, 3)
                       : Vec3(vertices.row(faces(f, 2)).transpose() - origin);
    const double part = a.cross(b).dot(c) / 6;
    sum += part;
    magnitude += std::abs(part);
  }
  return std::abs(sum) <= 1e-15 * magnitude;
}

enum class Side { kRight, kInsideOut };

absl::Status Overlapping(absl::string_view what) {
  return InvalidInput("CAGE_OVERLAPPING", kCornersField, what);
}

absl::Status CheckCrossings(const Positions& vertices, const Faces& faces) {
  const auto pair = FindSelfIntersection(vertices, faces);
  if (!pair) return absl::OkStatus();
  return Overlapping(absl::StrCat("faces ", pair->first, " and ", pair->second,
                                  " cross each other: the cage runs through "
                                  "itself"));
}

// Which side of the faces is inside. At the centroid of a face of a right cage
// the other faces wind 1/2 times, behind it 1 and before it 0 times; around an
// inside-out one -1/2 times. Anything else overlaps.
absl::StatusOr<Side> FindInside(const Positions& vertices, const Faces& faces) {
  const int64_t count = faces.rows();
  const int64_t sampled = std::clamp<int64_t>(kMaxFacePairs / count, 1, count);
  Side first = Side::kRight;
  for (int64_t i = 0; i < sampled; ++i) {
    const int64_t f = i * count / sampled;
    const double winding =
        WindingNumber(vertices, faces, Centroid(vertices, faces, f), f);
    const double behind = std::round(winding + 0.5);
    if (behind != 0 && behind != 1) {
      return Overlapping(absl::StrCat(
          "face ", f, " has not the inside on one side only: the cage winds ",
          behind, " times around points behind it and ", behind - 1,
          " times around points before it; parts of the cage overlap, or one "
          "of them is inverted"));
    }
    const Side side = behind == 1 ? Side::kRight : Side::kInsideOut;
    if (i == 0) first = side;
    if (side != first) {
      return Overlapping(absl::StrCat(
          "face 0 points ", first == Side::kRight ? "outwards" : "inwards",
          " and face ", f, side == Side::kRight ? " outwards" : " inwards",
          ": one part of the cage is inverted"));
    }
  }
  if (EnclosesNothing(vertices, faces)) {
    return Overlapping(absl::StrCat("the cage encloses no ",
                                    faces.cols() == 2 ? "area" : "volume"));
  }
  return first;
}

}  // namespace

absl::StatusOr<Cage> Cage::Create(int dimension, Positions vertices,
                                  Faces faces, Orientation orientation) {
  DEFORM_RETURN_IF_ERROR(CheckShape(dimension, vertices, faces));
  DEFORM_RETURN_IF_ERROR(CheckPositions(vertices, "vertex", kVerticesField));
  if (dimension == 2) DEFORM_RETURN_IF_ERROR(CheckPlanar(vertices));
  DEFORM_RETURN_IF_ERROR(CheckIndices(faces, vertices.rows(), kCornersField));
  DEFORM_RETURN_IF_ERROR(CheckFaces(vertices, faces));
  DEFORM_RETURN_IF_ERROR(CheckClosed(faces, vertices.rows(), kCornersField));
  DEFORM_RETURN_IF_ERROR(CheckCrossings(vertices, faces));
  DEFORM_ASSIGN_OR_RETURN(const Side inside, FindInside(vertices, faces));
  if (inside == Side::kInsideOut) {
    if (orientation == Orientation::kAsGiven) {
      return InvalidInput("CAGE_INVERTED", kCornersField,
                          "the cage is inside out: its faces point inwards");
    }
    faces.col(0).swap(faces.col(1));
  }
  return Cage(dimension, std::move(vertices), std::move(faces));
}

Cage::Cage(int dimension, Positions vertices, Faces faces)
    : dimension_(dimension),
      vertices_(std::move(vertices)),
      faces_(std::move(faces)),
      diagonal_(BoxOf(vertices_).diagonal()) {}

double WindingNumber(const Cage& cage, const Vec3& point) {
  return WindingNumber(cage.vertices(), cage.faces(), point);
}

}  // namespace deform
