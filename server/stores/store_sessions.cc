// Sessions and their poses in the tables of a store.
#include <limits>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/status_macros.h"
#include "server/stores/row_bytes.h"
#include "server/stores/store_database.h"
#include "server/stores/store_errors.h"

namespace deform::server {
namespace {

// Changes in part are folded into the whole pose when there are so many, or
// when they are larger than it: reading stays quick, and the journal small.
constexpr int64_t kMaxChanges = 64;

}  // namespace

absl::StatusOr<StoreDatabase::SessionRow> StoreDatabase::FindSession(
    const StoreKey& key) {
  Statement find = database_->Prepare(
      "SELECT number, body FROM sessions WHERE tenant = ? AND id = ?");
  DEFORM_ASSIGN_OR_RETURN(const bool found,
                          find.Bind(key.tenant).Bind(key.id).Step());
  if (!found) return NotStored("session", key);
  auto session = DecodeSession(key, find.Blob(1));
  if (!session) return EntryDamaged("session", key);
  return SessionRow{find.Int(0), *std::move(session)};
}

absl::StatusOr<StoreDatabase::SessionRow> StoreDatabase::FindSession(
    int64_t number) {
  Statement find = database_->Prepare(
      "SELECT tenant, id, body FROM sessions WHERE number = ?");
  DEFORM_ASSIGN_OR_RETURN(const bool found, find.Bind(number).Step());
  if (!found) return NotStored("session", {"", absl::StrCat(number)});
  const StoreKey key = {find.Text(0), find.Text(1)};
  auto session = DecodeSession(key, find.Blob(2));
  if (!session) return EntryDamaged("session", key);
  return SessionRow{number, *std::move(session)};
}

absl::StatusOr<int64_t> StoreDatabase::PutSession(
    const StoredSession& session) {
  const StoreKey binding = {session.key.tenant, session.binding_id};
  DEFORM_ASSIGN_OR_RETURN(const bool bound, HasBinding(binding));
  if (!bound) return NotStored("binding", binding);
  const std::string body = Encode(session);
  Statement put = database_->Prepare(
      "INSERT INTO sessions(tenant, id, binding_id, body) VALUES(?, ?, ?, ?) "
      "ON CONFLICT DO NOTHING RETURNING number");
  put.Bind(session.key.tenant).Bind(session.key.id);
  put.Bind(session.binding_id).BindBlob(body);
  DEFORM_ASSIGN_OR_RETURN(const bool made, put.Step());
  if (made) {
    const int64_t number = put.Int(0);
    // Done only when the statement is.
    DEFORM_RETURN_IF_ERROR(put.Run());
    return number;
  }
  return SessionExists(session.key);
}

absl::Status StoreDatabase::DeleteSession(const StoreKey& key) {
  Statement remove =
      database_->Prepare("DELETE FROM sessions WHERE tenant = ? AND id = ?");
  DEFORM_RETURN_IF_ERROR(remove.Bind(key.tenant).Bind(key.id).Run());
  return database_->changes() > 0 ? absl::OkStatus()
                                  : NotStored("session", key);
}

absl::Status StoreDatabase::WriteSession(int64_t number,
                                         const StoredSession& session) {
  const std::string body = Encode(session);
  Statement write = database_->Prepare(
      "UPDATE sessions SET binding_id = ?, body = ? WHERE number = ?");
  return write.Bind(session.binding_id).BindBlob(body).Bind(number).Run();
}

absl::StatusOr<std::vector<uint64_t>> StoreDatabase::RaiseEpochs(
    std::span<const StoreKey> keys) {
  std::vector<uint64_t> epochs;
  const auto raise = [&]() -> absl::Status {
    for (const StoreKey& key : keys) {
      DEFORM_ASSIGN_OR_RETURN(SessionRow row, FindSession(key));
      epochs.push_back(++row.session.epoch);
      DEFORM_RETURN_IF_ERROR(WriteSession(row.number, row.session));
    }
    return absl::OkStatus();
  };
  DEFORM_RETURN_IF_ERROR(Atomically(raise));
  return epochs;
}

absl::StatusOr<SessionPose> StoreDatabase::LoadPose(const StoreKey& key) {
  DEFORM_ASSIGN_OR_RETURN(const SessionRow row, FindSession(key));
  return ReadPoses(row);
}

absl::StatusOr<SessionPose> StoreDatabase::ReadPoses(const SessionRow& row) {
  SessionPose pose{.binding_id = row.session.binding_id,
                   .epoch = row.session.epoch};
  const absl::Status damaged = EntryDamaged("session", row.session.key);
  Statement read = database_->Prepare(
      "SELECT revision, body FROM poses WHERE session = ? ORDER BY revision");
  read.Bind(row.number);
  while (true) {
    DEFORM_ASSIGN_OR_RETURN(const bool more, read.Step());
    if (!more) return pose;
    const auto append = DecodePose(read.Blob(1));
    if (!append || append->whole != (pose.revision == 0) ||
        append->revision != static_cast<uint64_t>(read.Int(0))) {
      return damaged;
    }
    for (const int32_t moved : append->rows) {
      if (moved < 0 || moved >= pose.pose.vertices.rows()) return damaged;
    }
    Apply(*append, pose);
  }
}

absl::StatusOr<std::vector<StoreDatabase::NumberedHead>>
StoreDatabase::LoadHeads() {
  std::vector<SessionRow> rows;
  {
    Statement read = database_->Prepare(
        "SELECT number, tenant, id, body "
        "FROM sessions");
    while (true) {
      DEFORM_ASSIGN_OR_RETURN(const bool more, read.Step());
      if (!more) break;
      const StoreKey key = {read.Text(1), read.Text(2)};
      auto session = DecodeSession(key, read.Blob(3));
      if (session) rows.push_back({read.Int(0), *std::move(session)});
    }
  }
  std::vector<NumberedHead> heads;
  for (const SessionRow& row : rows) {
    DEFORM_ASSIGN_OR_RETURN(const uint64_t last, LastRevision(row.number));
    PoseHead head{.session = row.number,
                  .epoch = row.session.epoch,
                  .accepted = last,
                  .durable = last};
    const absl::StatusOr<SessionPose> pose = ReadPoses(row);
    if (pose.ok()) {
      head.rows = pose->pose.vertices.rows();
    } else if (!absl::IsDataLoss(pose.status())) {
      return pose.status();
    }
    heads.push_back({row.session.key, head});
  }
  return heads;
}

absl::StatusOr<uint64_t> StoreDatabase::LastRevision(int64_t session) {
  Statement last =
      database_->Prepare("SELECT max(revision) FROM poses WHERE session = ?");
  DEFORM_RETURN_IF_ERROR(last.Bind(session).Step().status());
  return static_cast<uint64_t>(last.Int(0));
}

absl::Status StoreDatabase::Append(int64_t session, uint64_t after,
                                   const PoseAppend& append,
                                   absl::Status& refused) {
  absl::StatusOr<SessionRow> row = FindSession(session);
  if (absl::IsNotFound(row.status()) || absl::IsDataLoss(row.status())) {
    refused = row.status();
    return absl::OkStatus();
  }
  if (!row.ok()) return row.status();
  DEFORM_ASSIGN_OR_RETURN(const uint64_t last, LastRevision(session));
  // What was checked when it was accepted, against what has come of it.
  const PoseHead head{.epoch = row->session.epoch,
                      .accepted = last,
                      .rows = std::numeric_limits<int32_t>::max()};
  refused = CheckFollows(append, after, head);
  if (!refused.ok()) return absl::OkStatus();
  if (!append.binding_id.empty() &&
      append.binding_id != row->session.binding_id) {
    const StoreKey binding = {append.session.tenant, append.binding_id};
    DEFORM_ASSIGN_OR_RETURN(const bool bound, HasBinding(binding));
    if (!bound) {
      refused = NotStored("binding", binding);
      return absl::OkStatus();
    }
    row->session.binding_id = append.binding_id;
    DEFORM_RETURN_IF_ERROR(WriteSession(session, row->session));
  }
  DEFORM_RETURN_IF_ERROR(WritePose(session, append));
  if (append.whole) return absl::OkStatus();
  DEFORM_ASSIGN_OR_RETURN(const bool many, NeedsCompaction(session));
  if (!many) return absl::OkStatus();
  DEFORM_ASSIGN_OR_RETURN(const SessionPose pose, ReadPoses(*row));
  return WritePose(session, WholeOf(append.session, pose));
}

absl::Status StoreDatabase::WritePose(int64_t session,
                                      const PoseAppend& append) {
  if (append.whole) {
    Statement clear = database_->Prepare("DELETE FROM poses WHERE session = ?");
    DEFORM_RETURN_IF_ERROR(clear.Bind(session).Run());
  }
  const std::string body = EncodePose(append);
  Statement write = database_->Prepare(
      "INSERT INTO poses(session, revision, whole, body) VALUES(?, ?, ?, ?)");
  return write.Bind(session)
      .Bind(append.revision)
      .Bind(int64_t{append.whole})
      .BindBlob(body)
      .Run();
}

absl::StatusOr<bool> StoreDatabase::NeedsCompaction(int64_t session) {
  Statement measure = database_->Prepare(
      "SELECT sum(whole = 0), sum((whole = 0) * length(body)), "
      "sum((whole = 1) * length(body)) FROM poses WHERE session = ?");
  DEFORM_RETURN_IF_ERROR(measure.Bind(session).Step().status());
  return measure.Int(0) >= kMaxChanges || measure.Int(1) > measure.Int(2);
}

}  // namespace deform::server
