#include "core/weights/unbindable.h"

#include <algorithm>
#include <iterator>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/base/error.h"

namespace deform {
namespace {

constexpr size_t kNamedPoints = 10;

struct Reason {
  const char* id;
  const char* of_one;
  const char* of_many;
  const char* advice;
};

// In the order in which they are told.
constexpr Reason kReasons[] = {
    {"EXTERIOR_NO_EXIT_FACE", "lies outside the cage and has no exit face",
     "lie outside the cage and have no exit face", ""},
    {"EXIT_AMBIGUOUS", "lies outside the cage and has no single exit face",
     "lie outside the cage and have no single exit face", ""},
    {"OUTSIDE_HULL", "lies outside the convex hull of the handles",
     "lie outside the convex hull of the handles",
     "add handles around them, or the corners of the model's box as fixed "
     "handles (add_box_handles, --add-box)"},
    {"NOT_CONVERGED",
     "is so close to the hull that the solver found no weights",
     "are so close to the hull that the solver found no weights",
     "add handles around them, or bind without user weights"},
    {kWeightTooLarge, "is so far outside that float cannot hold its weights",
     "are so far outside that float cannot hold their weights",
     "move the model closer to the cage"},
};

std::string Describe(const Reason& reason, std::vector<int64_t> points,
                     absl::string_view advice) {
  std::sort(points.begin(), points.end());
  const size_t named = std::min(points.size(), kNamedPoints);
  return absl::StrCat(
      points.size(), points.size() == 1 ? " point " : " points ",
      points.size() == 1 ? reason.of_one : reason.of_many, ": ",
      absl::StrJoin(points.begin(), points.begin() + named, ", "),
      named < points.size() ? ", ..." : "", advice.empty() ? "" : "; ", advice);
}

}  // namespace

const char* UnboundReason(PointState state) {
  switch (state) {
    case PointState::kOutsideHull:
      return "OUTSIDE_HULL";
    case PointState::kNotConverged:
      return "NOT_CONVERGED";
    default:
      return nullptr;
  }
}

std::string UnboundAdvice(const std::string& reason) {
  const auto at = std::find_if(std::begin(kReasons), std::end(kReasons),
                               [&](const Reason& r) { return r.id == reason; });
  return at == std::end(kReasons) ? "" : at->advice;
}

absl::Status UnbindableError(const std::vector<UnboundPoints>& unbound) {
  std::string first_reason, message;
  for (const Reason& reason : kReasons) {
    std::vector<int64_t> points;
    std::string advice;
    for (const UnboundPoints& group : unbound) {
      if (group.reason != reason.id) continue;
      if (points.empty()) advice = group.detail;
      points.insert(points.end(), group.points.begin(), group.points.end());
    }
    if (points.empty()) continue;
    if (first_reason.empty()) first_reason = reason.id;
    absl::StrAppend(&message, message.empty() ? "" : ". ",
                    Describe(reason, std::move(points), advice));
  }
  if (message.empty()) return absl::OkStatus();
  return MakeError(absl::StatusCode::kFailedPrecondition, message,
                   {.reason = first_reason, .field = "exits"});
}

}  // namespace deform
