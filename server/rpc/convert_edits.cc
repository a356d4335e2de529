// The conversions of EditHandles.
#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "server/rpc/convert.h"

namespace deform::server {
namespace {

absl::StatusOr<Vec3> ToPlace(
    const google::protobuf::RepeatedField<double>& numbers, int dimension,
    int edit) {
  if (numbers.size() != dimension) {
    return InvalidInput(
        "WRONG_LENGTH", "edits",
        absl::StrCat("edit ", edit, " has a place of ", numbers.size(),
                     " numbers; the binding is ", dimension, "D"));
  }
  Vec3 place = Vec3::Zero();
  std::copy(numbers.begin(), numbers.end(), place.data());
  return place;
}

}  // namespace

absl::StatusOr<EditRequest> FromProto(const v1::EditHandlesRequest& request) {
  EditRequest edit{
      .binding_id = request.binding_id(),
      .sessions = {request.session_ids().begin(), request.session_ids().end()},
      .keep_sessions = request.keep_sessions()};
  DEFORM_ASSIGN_OR_RETURN(edit.tenant, TenantOr(request.tenant()));
  for (const std::string& id : edit.sessions) {
    DEFORM_RETURN_IF_ERROR(CheckName(id, "session_ids"));
  }
  if (edit.keep_sessions && !edit.sessions.empty()) {
    return InvalidInput("CONTRADICTION", "keep_sessions",
                        "sessions are named to move, and none is to move");
  }
  std::sort(edit.sessions.begin(), edit.sessions.end());
  edit.sessions.erase(std::unique(edit.sessions.begin(), edit.sessions.end()),
                      edit.sessions.end());
  return edit;
}

absl::StatusOr<std::vector<HandleEdit>> FromProto(
    const google::protobuf::RepeatedPtrField<v1::HandleEdit>& edits,
    int dimension) {
  std::vector<HandleEdit> result;
  for (int i = 0; i < edits.size(); ++i) {
    HandleEdit edit;
    switch (edits[i].edit_case()) {
      case v1::HandleEdit::kAdd: {
        edit.kind = HandleEdit::Kind::kAdd;
        DEFORM_ASSIGN_OR_RETURN(
            edit.position, ToPlace(edits[i].add().position(), dimension, i));
        edit.weight = edits[i].add().weight();
        break;
      }
      case v1::HandleEdit::kMove: {
        edit.kind = HandleEdit::Kind::kMove;
        edit.handle = edits[i].move().handle();
        DEFORM_ASSIGN_OR_RETURN(
            edit.position, ToPlace(edits[i].move().position(), dimension, i));
        break;
      }
      case v1::HandleEdit::kRemove:
        edit.kind = HandleEdit::Kind::kRemove;
        edit.handle = edits[i].remove().handle();
        break;
      case v1::HandleEdit::EDIT_NOT_SET:
        return InvalidInput(
            "MISSING_FIELD", "edits",
            absl::StrCat("edit ", i, " neither adds, moves nor removes"));
    }
    result.push_back(edit);
  }
  return result;
}

}  // namespace deform::server
