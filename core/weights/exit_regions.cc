#include "core/weights/exit_regions.h"

#include <algorithm>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/weights/cage_faces.h"

namespace deform {
namespace {

constexpr char kNoExitFace[] = "EXTERIOR_NO_EXIT_FACE";
constexpr char kAmbiguous[] = "EXIT_AMBIGUOUS";

// A model edge with one end outside.
struct Crossing {
  int64_t outside;
  int64_t inside;
  auto operator<=>(const Crossing&) const = default;
};

// How many crossing edges leave through a face.
using Votes = std::map<int32_t, int64_t>;

// The outside part of a model: its connected components and the edges that
// reach it from inside. O(N + F), whatever the cage.
class OutsidePart {
 public:
  OutsidePart(const Mesh& model, std::span<const PointState> states)
      : states_(states), parent_(model.size()) {
    std::iota(parent_.begin(), parent_.end(), 0);
    const Faces& faces = model.faces();
    for (int64_t f = 0; f < faces.rows(); ++f) {
      for (int k = 0; k < 3; ++k) AddEdge(faces(f, k), faces(f, (k + 1) % 3));
    }
    std::sort(crossings_.begin(), crossings_.end());
    crossings_.erase(std::unique(crossings_.begin(), crossings_.end()),
                     crossings_.end());
  }

  bool IsOutside(int64_t i) const { return states_[i] == PointState::kOutside; }

  // Each edge once, sorted.
  const std::vector<Crossing>& crossings() const { return crossings_; }

  // The lowest point of the component of an outside point.
  int64_t Component(int64_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }

 private:
  void AddEdge(int64_t a, int64_t b) {
    if (IsOutside(a) && IsOutside(b)) {
      const int64_t root_a = Component(a), root_b = Component(b);
      parent_[std::max(root_a, root_b)] = std::min(root_a, root_b);
    } else if (IsOutside(a)) {
      crossings_.push_back({a, b});
    } else if (IsOutside(b)) {
      crossings_.push_back({b, a});
    }
  }

  const std::span<const PointState> states_;
  std::vector<int64_t> parent_;
  std::vector<Crossing> crossings_;
};

// Where a segment from inside to outside leaves through the plane of a face.
struct Meeting {
  int32_t face;
  double at;    // 0 at the inside end, 1 at the outside end.
  double miss;  // By how much it misses the face, as a fraction; 0 is a hit.
};

// Nothing if it misses by more than `worst`.
std::optional<Meeting> Meet(const CageFaces& faces, int32_t f,
                            const Vec3& inside, const Vec3& outside,
                            double worst) {
  const CageFaces::Face& face = faces[f];
  const double from = face.normal.dot(inside - face.position[0]);
  const double to = face.normal.dot(outside - face.position[0]);
  if (!(to > from)) return std::nullopt;  // Parallel, or on the way in.
  const double at = -from / (to - from);
  const double beyond = std::max({0.0, -at, at - 1});
  if (beyond > worst) return std::nullopt;
  const Vec3 hit = inside + at * (outside - inside);
  const double off =
      -faces.Barycentric(f, hit).head(faces.corners()).minCoeff();
  return Meeting{f, at, std::max(beyond, off)};
}

// The face through which the outside end of a segment left the cage: the last
// one crossed. Where that is an edge of the cage, of the faces that meet there
// a named one, then the lowest. Rounding may let a segment slip between two
// faces or start a hair outside; then the face that it misses least.
int32_t CrossedFace(const CageFaces& faces, const std::vector<char>& named,
                    const Vec3& inside, const Vec3& outside) {
  constexpr double kSlack = 1e-9;
  std::vector<Meeting> hits;
  Meeting closest{-1, 0, std::numeric_limits<double>::infinity()};
  double last = 0;
  for (int32_t f = 0; f < faces.size(); ++f) {
    const std::optional<Meeting> meeting =
        Meet(faces, f, inside, outside, std::max(closest.miss, kSlack));
    if (!meeting) continue;
    if (meeting->miss < closest.miss) closest = *meeting;
    if (meeting->miss > kSlack) continue;
    hits.push_back(*meeting);
    last = std::max(last, meeting->at);
  }
  int32_t best = -1;
  for (const Meeting& hit : hits) {
    if (hit.at < last - kSlack) continue;
    if (best < 0 || named[hit.face] > named[best]) best = hit.face;
  }
  return best >= 0 ? best : closest.face;
}

// Whether faces a and b share an edge (2D: a vertex).
bool Touch(const CageFaces& faces, int32_t a, int32_t b) {
  int shared = 0;
  for (int i = 0; i < faces.corners(); ++i) {
    for (int j = 0; j < faces.corners(); ++j) {
      shared += faces[a].corner[i] == faces[b].corner[j];
    }
  }
  return shared >= faces.corners() - 1;
}

// Whether one can walk between any two of the faces over shared edges.
bool FormOnePatch(const CageFaces& faces, std::vector<int32_t> rest) {
  std::vector<int32_t> reached = {rest.back()};
  rest.pop_back();
  for (size_t i = 0; i < reached.size(); ++i) {
    const auto touching = std::partition(
        rest.begin(), rest.end(),
        [&](int32_t face) { return !Touch(faces, reached[i], face); });
    reached.insert(reached.end(), touching, rest.end());
    rest.erase(touching, rest.end());
  }
  return rest.empty();
}

// "3", "3 and 7", "3, 7 and 9"; at most ten.
std::string List(const std::vector<int32_t>& faces) {
  const size_t shown = std::min<size_t>(faces.size(), 10);
  const bool cut = shown < faces.size();
  const size_t before = cut || shown == 1 ? shown : shown - 1;
  std::string list = absl::StrJoin(faces.begin(), faces.begin() + before, ", ");
  if (cut) return absl::StrCat(list, " and ", faces.size() - shown, " more");
  return before == shown ? list : absl::StrCat(list, " and ", faces.back());
}

// What becomes of a part: an exit face, or why there is none.
struct Verdict {
  int32_t exit_face = -1;
  const char* reason = "";
  std::string detail;
};

Verdict ChooseAmongAll(const CageFaces& faces, const Votes& votes) {
  std::vector<int32_t> crossed;
  Verdict verdict;
  int64_t most = 0;
  for (const auto& [face, count] : votes) {
    crossed.push_back(face);
    if (count > most) {
      most = count;
      verdict.exit_face = face;
    }
  }
  if (FormOnePatch(faces, crossed)) return verdict;
  return {-1, kAmbiguous,
          absl::StrCat("their part of the model crosses faces ", List(crossed),
                       ", which do not touch: name one of them, or give an "
                       "exit face per point")};
}

Verdict ChooseAmongNamed(const std::vector<char>& named, const Votes& votes) {
  std::vector<int32_t> crossed, allowed;
  for (const auto& [face, count] : votes) {
    crossed.push_back(face);
    if (named[face]) allowed.push_back(face);
  }
  if (allowed.size() == 1) return {.exit_face = allowed[0]};
  if (allowed.empty()) {
    return {-1, kNoExitFace,
            absl::StrCat("their part of the model crosses ",
                         crossed.size() == 1 ? "face " : "faces ",
                         List(crossed), ", none of the named")};
  }
  return {-1, kAmbiguous,
          absl::StrCat("their part of the model crosses the named faces ",
                       List(allowed),
                       ": name one of them, or give an exit face per point")};
}

// Gathers the result; points must be added in rising order.
class Assignment {
 public:
  // `key` tells parts with the same exit face apart.
  void Add(int64_t point, int64_t key, const Verdict& verdict,
           const Votes& votes) {
    if (verdict.exit_face < 0) {
      unbound_[{verdict.reason, verdict.detail}].push_back(point);
      return;
    }
    const auto [at, is_new] = index_.emplace(key, result_.parts.size());
    if (is_new) {
      result_.parts.push_back({.exit_face = verdict.exit_face});
      for (const auto& [face, count] : votes) {
        if (face == verdict.exit_face) continue;
        result_.parts.back().crossed_faces.push_back(face);
      }
    }
    result_.parts[at->second].points.push_back(point);
  }

  ExitAssignment Take() && {
    for (auto& [why, points] : unbound_) {
      result_.unbound.push_back({why.first, why.second, std::move(points)});
    }
    return std::move(result_);
  }

 private:
  ExitAssignment result_;
  std::map<int64_t, size_t> index_;
  std::map<std::pair<std::string, std::string>, std::vector<int64_t>> unbound_;
};

// One assignment: everything its steps share.
class Assigner {
 public:
  Assigner(const Mesh& model, const Cage& cage,
           std::span<const PointState> states, const ExitRegions& regions)
      : model_(model),
        faces_(cage),
        regions_(regions),
        outside_(model, states),
        named_(cage.face_count(), regions.kind != ExitRegions::Kind::kFaces) {
    for (int32_t f : regions.faces) named_[f] = 1;
  }

  ExitAssignment ByComponent();
  ExitAssignment ByPoint();
  ExitAssignment ByDistance();
  ExitAssignment None();

 private:
  Vec3 Point(int64_t i) const { return model_.positions().row(i); }
  // Votes of the parts that `part_of` (outside point -> key) makes.
  template <typename PartOf>
  std::map<int64_t, Votes> CountVotes(const PartOf& part_of);
  Verdict Choose(const Votes& votes) const;

  const Mesh& model_;
  const CageFaces faces_;
  const ExitRegions& regions_;
  OutsidePart outside_;
  std::vector<char> named_;  // F
};

template <typename PartOf>
std::map<int64_t, Votes> Assigner::CountVotes(const PartOf& part_of) {
  std::map<int64_t, Votes> votes;
  for (const auto& [outside, inside] : outside_.crossings()) {
    const int32_t face =
        CrossedFace(faces_, named_, Point(inside), Point(outside));
    if (face >= 0) ++votes[part_of(outside)][face];
  }
  return votes;
}

Verdict Assigner::Choose(const Votes& votes) const {
  if (votes.empty()) {
    return {-1, kNoExitFace,
            "their part of the model does not cross the cage: give an exit "
            "face per point"};
  }
  return regions_.kind == ExitRegions::Kind::kAutomatic
             ? ChooseAmongAll(faces_, votes)
             : ChooseAmongNamed(named_, votes);
}

ExitAssignment Assigner::ByComponent() {
  std::map<int64_t, Votes> votes =
      CountVotes([&](int64_t i) { return outside_.Component(i); });
  std::map<int64_t, Verdict> verdicts;
  Assignment assignment;
  for (int64_t i = 0; i < model_.size(); ++i) {
    if (!outside_.IsOutside(i)) continue;
    const int64_t component = outside_.Component(i);
    const Votes& of_component = votes[component];
    if (i == component) verdicts[component] = Choose(of_component);
    assignment.Add(i, component, verdicts[component], of_component);
  }
  return std::move(assignment).Take();
}

ExitAssignment Assigner::ByPoint() {
  const auto face_of = [&](int64_t i) { return regions_.face_of_point[i]; };
  std::map<int64_t, Votes> votes = CountVotes(face_of);
  Assignment assignment;
  for (int64_t i = 0; i < model_.size(); ++i) {
    if (!outside_.IsOutside(i)) continue;
    const int32_t face = face_of(i);
    assignment.Add(i, face,
                   {face, kNoExitFace, "their entries of exit faces are -1"},
                   votes[face]);
  }
  return std::move(assignment).Take();
}

ExitAssignment Assigner::ByDistance() {
  Assignment assignment;
  for (int64_t i = 0; i < model_.size(); ++i) {
    if (!outside_.IsOutside(i)) continue;
    const auto face =
        static_cast<int32_t>(faces_.NearestOf(Point(i), named_).face);
    assignment.Add(i, face, {.exit_face = face}, {});
  }
  return std::move(assignment).Take();
}

ExitAssignment Assigner::None() {
  Assignment assignment;
  for (int64_t i = 0; i < model_.size(); ++i) {
    if (!outside_.IsOutside(i)) continue;
    assignment.Add(
        i, 0, {-1, kNoExitFace, "name exit faces or choose them automatically"},
        {});
  }
  return std::move(assignment).Take();
}

absl::Status CheckFace(int32_t face, const Cage& cage, absl::string_view field,
                       absl::string_view what) {
  if (face >= 0 && face < cage.face_count()) return absl::OkStatus();
  return InvalidInput(
      "EXIT_FACE_OUT_OF_RANGE", field,
      absl::StrCat(what, " refers to face ", face, " of ", cage.face_count()));
}

absl::Status CheckPerPoint(const std::vector<int32_t>& faces, const Cage& cage,
                           int64_t points) {
  constexpr char kField[] = "exits.per_point.faces";
  if (static_cast<int64_t>(faces.size()) != points) {
    return InvalidInput("WRONG_LENGTH", kField,
                        absl::StrCat("there are ", faces.size(),
                                     " exit faces for ", points, " points"));
  }
  for (size_t i = 0; i < faces.size(); ++i) {
    if (faces[i] == -1) continue;
    DEFORM_RETURN_IF_ERROR(CheckFace(
        faces[i], cage, kField, absl::StrCat("the exit face of point ", i)));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status CheckExitRegions(const ExitRegions& regions, const Cage& cage,
                              int64_t points) {
  constexpr char kField[] = "exits.faces.faces";
  switch (regions.kind) {
    case ExitRegions::Kind::kNone:
    case ExitRegions::Kind::kAutomatic:
      return absl::OkStatus();
    case ExitRegions::Kind::kPerPoint:
      return CheckPerPoint(regions.face_of_point, cage, points);
    case ExitRegions::Kind::kFaces:
      break;
  }
  if (regions.faces.empty()) {
    return InvalidInput("NO_EXIT_FACES", kField,
                        "the list of exit faces is empty: leave it out, or "
                        "name at least one");
  }
  for (size_t i = 0; i < regions.faces.size(); ++i) {
    DEFORM_RETURN_IF_ERROR(CheckFace(regions.faces[i], cage, kField,
                                     absl::StrCat("exit face ", i)));
  }
  return absl::OkStatus();
}

ExitAssignment AssignExitFaces(const Mesh& model, const Cage& cage,
                               std::span<const PointState> states,
                               const ExitRegions& regions) {
  Assigner assigner(model, cage, states, regions);
  switch (regions.kind) {
    case ExitRegions::Kind::kNone:
      return assigner.None();
    case ExitRegions::Kind::kPerPoint:
      return assigner.ByPoint();
    case ExitRegions::Kind::kAutomatic:
    case ExitRegions::Kind::kFaces:
      break;
  }
  return model.faces().rows() == 0 ? assigner.ByDistance()
                                   : assigner.ByComponent();
}

}  // namespace deform
