#include "server/stores/poses.h"

#include <algorithm>
#include <unordered_map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/stores/bytes.h"

namespace deform::server {
namespace {

absl::Status WrongMoment(absl::string_view reason, absl::string_view message,
                         const StoreKey& session) {
  return MakeError(absl::StatusCode::kFailedPrecondition,
                   absl::StrCat("session \"", session.id, "\": ", message),
                   {.reason = std::string(reason),
                    .resource_type = "session",
                    .resource_name = session.id});
}

absl::Status BadPose(absl::string_view message) {
  return InvalidInput("BAD_POSE", "pose", message);
}

absl::Status CheckShape(const PoseAppend& append, int64_t rows) {
  if (append.whole) {
    if (append.positions.rows() == 0) return BadPose("a whole pose has no row");
    if (!append.rows.empty()) return BadPose("a whole pose names rows");
    return absl::OkStatus();
  }
  if (!append.binding_id.empty()) {
    return BadPose("another rig needs a whole pose");
  }
  if (append.positions.rows() != static_cast<int64_t>(append.rows.size())) {
    return BadPose(absl::StrCat(append.rows.size(), " rows are named, ",
                                append.positions.rows(), " given"));
  }
  for (const int32_t row : append.rows) {
    if (row < 0 || row >= rows) {
      return BadPose(absl::StrCat("row ", row, " of ", rows));
    }
  }
  return absl::OkStatus();
}

void Raise(const AnsweredSequences& from, AnsweredSequences& to) {
  for (const auto& [client, sequence] : from) {
    uint64_t& known = to[client];
    known = std::max(known, sequence);
  }
}

// A change in part onto a change in part.
void FoldRows(const PoseAppend& next, PoseAppend& into) {
  std::unordered_map<int32_t, int64_t> places;
  for (size_t i = 0; i < into.rows.size(); ++i) {
    places[into.rows[i]] = static_cast<int64_t>(i);
  }
  for (const int32_t row : next.rows) {
    if (places.emplace(row, into.rows.size()).second) into.rows.push_back(row);
  }
  into.positions.conservativeResize(static_cast<int64_t>(into.rows.size()), 3);
  for (size_t i = 0; i < next.rows.size(); ++i) {
    into.positions.row(places[next.rows[i]]) =
        next.positions.row(static_cast<int64_t>(i));
  }
}

void MoveRows(const PoseAppend& append, Positions& positions) {
  for (size_t i = 0; i < append.rows.size(); ++i) {
    positions.row(append.rows[i]) =
        append.positions.row(static_cast<int64_t>(i));
  }
}

}  // namespace

absl::Status CheckFollows(const PoseAppend& append, uint64_t after,
                          const PoseHead& head) {
  if (append.epoch != head.epoch) {
    return WrongMoment(
        "STALE_EPOCH",
        absl::StrCat("written in epoch ", append.epoch,
                     ", but it was taken over in epoch ", head.epoch),
        append.session);
  }
  if (append.revision <= head.accepted) {
    return WrongMoment("STALE_REVISION",
                       absl::StrCat("revision ", append.revision,
                                    " does not come after ", head.accepted),
                       append.session);
  }
  if (!append.whole && (head.rows == 0 || after != head.accepted)) {
    return WrongMoment(
        "REVISION_GAP",
        absl::StrCat("revision ", append.revision, " changes a part of ", after,
                     ", but the last is ", head.accepted,
                     "; a whole pose must come"),
        append.session);
  }
  return CheckShape(append, head.rows);
}

void Fold(const PoseAppend& next, PoseAppend& into) {
  if (next.whole) {
    std::string binding =
        next.binding_id.empty() ? std::move(into.binding_id) : next.binding_id;
    into = next;
    into.binding_id = std::move(binding);
    return;
  }
  if (into.whole) {
    MoveRows(next, into.positions);
  } else {
    FoldRows(next, into);
  }
  into.revision = next.revision;
  into.stretch_blend = next.stretch_blend;
  Raise(next.answers, into.answers);
}

void Apply(const PoseAppend& append, SessionPose& pose) {
  if (append.whole) {
    pose.pose.vertices = append.positions;
    pose.answers = append.answers;
    if (!append.binding_id.empty()) pose.binding_id = append.binding_id;
  } else {
    MoveRows(append, pose.pose.vertices);
    Raise(append.answers, pose.answers);
  }
  pose.pose.stretch_blend = append.stretch_blend;
  pose.revision = append.revision;
}

PoseAppend WholeOf(const StoreKey& session, const SessionPose& pose) {
  return {.session = session,
          .epoch = pose.epoch,
          .revision = pose.revision,
          .positions = pose.pose.vertices,
          .stretch_blend = pose.pose.stretch_blend,
          .answers = pose.answers};
}

int64_t BytesOf(const PoseAppend& append) {
  int64_t bytes = static_cast<int64_t>(
      sizeof(append) + append.rows.size() * sizeof(int32_t) +
      static_cast<size_t>(append.positions.size()) * sizeof(double));
  for (const auto& [client, sequence] : append.answers) {
    bytes += static_cast<int64_t>(client.size()) + 64;
  }
  return bytes;
}

std::string EncodePose(const PoseAppend& append) {
  ByteWriter writer;
  writer.Add(append.epoch).Add(append.revision).Add(uint64_t{append.whole});
  writer.Add(append.stretch_blend).Add(uint64_t{append.answers.size()});
  for (const auto& [client, sequence] : append.answers) {
    writer.Add(client).Add(sequence);
  }
  const uint64_t rows = static_cast<uint64_t>(append.positions.rows());
  writer.Add(rows);
  writer.AddRaw(append.positions.data(), rows * 3 * sizeof(double));
  writer.AddRaw(append.rows.data(), append.rows.size() * sizeof(int32_t));
  return writer.Seal();
}

std::optional<PoseAppend> DecodePose(std::span<const std::byte> bytes) {
  ByteReader reader = ByteReader::Unseal(bytes);
  PoseAppend append;
  append.epoch = reader.U64();
  append.revision = reader.U64();
  append.whole = reader.U64() != 0;
  append.stretch_blend = reader.Double();
  const uint64_t answers = reader.U64();
  for (uint64_t i = 0; i < answers && reader.ok(); ++i) {
    const std::string client = reader.String();
    append.answers[client] = reader.U64();
  }
  const uint64_t rows = reader.U64();
  if (!reader.ok() || rows > reader.left()) return std::nullopt;
  const auto positions = reader.Raw(rows * 3 * sizeof(double));
  if (!reader.ok()) return std::nullopt;
  append.positions.resize(static_cast<int64_t>(rows), 3);
  std::copy(positions.begin(), positions.end(),
            reinterpret_cast<std::byte*>(append.positions.data()));
  if (!append.whole) {
    const auto named = reader.Raw(rows * sizeof(int32_t));
    append.rows.resize(named.size() / sizeof(int32_t));
    std::copy(named.begin(), named.end(),
              reinterpret_cast<std::byte*>(append.rows.data()));
  }
  if (!reader.done()) return std::nullopt;
  return append;
}

}  // namespace deform::server
