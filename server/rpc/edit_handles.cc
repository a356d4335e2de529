// BindingService::EditHandles: a binding of edited handles, and the sessions
// that move over to it.
#include <memory>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "core/weights/handle_edit.h"
#include "server/rpc/await_binding.h"
#include "server/rpc/binding_service.h"
#include "server/rpc/status.h"
#include "server/sessions/rig_moves.h"

namespace deform::server {
namespace {

absl::StatusOr<const Handles*> HandlesOf(const BindingFacts& binding,
                                         const std::string& id) {
  const auto* handles = std::get_if<Handles>(&binding.rig());
  if (handles != nullptr) return handles;
  return InvalidInput("WRONG_RIG", "binding_id",
                      absl::StrCat("binding ", Quoted(id),
                                   " has a cage; only handles can be edited"));
}

// The old binding with other handles. All else is the same, so that the id is
// the one of the edited rig bound afresh.
BindSpec SpecOf(const BindingRecord& record, const EditedHandles& edited,
                std::shared_ptr<const Solutions> known) {
  const BindRequest& request = record.facts.request();
  return {.tenant = record.tenant,
          .model_id = record.model_id,
          .rig = edited.handles,
          .scheme = request.scheme,
          .options = edited.options,
          .exits = request.exits,
          .unbindable = request.unbindable,
          .clamped = request.clamped,
          .weight_tolerance = record.weight_tolerance,
          .known = std::move(known)};
}

void Tell(const RigMoves& moves, v1::HandlesEdited* out) {
  for (const RigMoves::Outcome& outcome : moves.outcomes()) {
    if (outcome.moved.ok()) {
      v1::SessionMoved* moved = out->add_moved();
      moved->set_session_id(outcome.session_id);
      moved->set_revision(outcome.moved->revision);
      moved->set_largest_jump(outcome.moved->largest_jump);
    } else {
      v1::SessionNotMoved* not_moved = out->add_not_moved();
      not_moved->set_session_id(outcome.session_id);
      *not_moved->mutable_status() = ToRpcStatus(outcome.moved.status());
    }
  }
}

}  // namespace

grpc::Status BindingService::EditHandles(
    grpc::ServerContext* context, const v1::EditHandlesRequest* request,
    grpc::ServerWriter<v1::EditHandlesResponse>* writer) {
  return calls_.Run("EditHandles", *context, [&]() -> absl::Status {
    PeerWriter<v1::EditHandlesResponse> peer(calls_, *context, *writer);
    const auto keep_waiting = [&] { return !peer.IsGone(); };
    DEFORM_ASSIGN_OR_RETURN(const EditRequest wanted, FromProto(*request));
    DEFORM_RETURN_IF_ERROR(
        sessions_.CheckHave(wanted.tenant, wanted.sessions, wanted.binding_id));
    // It serves, and cannot be removed, until the new one is there.
    DEFORM_ASSIGN_OR_RETURN(
        const BindingInUse old,
        bindings_.Use(wanted.tenant, wanted.binding_id,
                      "an edit of its handles", keep_waiting));
    DEFORM_ASSIGN_OR_RETURN(const Handles* handles,
                            HandlesOf(*old.binding, wanted.binding_id));
    DEFORM_ASSIGN_OR_RETURN(const std::vector<HandleEdit> edits,
                            FromProto(request->edits(), handles->dimension()));
    DEFORM_ASSIGN_OR_RETURN(
        const EditedHandles edited,
        deform::EditHandles(*handles, old.binding->options(), edits));
    DEFORM_ASSIGN_OR_RETURN(const auto waiter,
                            bindings_.Create(SpecOf(*old.lease.record(), edited,
                                                    old.binding->solutions())));
    DEFORM_ASSIGN_OR_RETURN(
        const CreatedBinding created,
        AwaitBinding(*waiter, *context, [&](const BindProgress& p) {
          v1::EditHandlesResponse message;
          ToProto(p, message.mutable_progress());
          return peer.Write(message);
        }));
    RigMoves moves;
    if (!wanted.keep_sessions && created.record->id != wanted.binding_id) {
      sessions_.Move(*old.lease.record(), *created.record, edited.previous,
                     wanted.sessions, moves);
    }
    while (!moves.Wait(kPollInterval)) {
      if (!keep_waiting()) return absl::CancelledError();
    }
    v1::EditHandlesResponse message;
    v1::HandlesEdited* out = message.mutable_edited();
    Describe(*created.record, Detail::kFull, out->mutable_binding());
    out->mutable_binding()->set_existed(created.existed);
    out->mutable_previous_handles()->Add(edited.previous.begin(),
                                         edited.previous.end());
    out->set_iterations_mean(created.record->facts.quality().iterations_mean);
    out->set_iterations_mean_before(old.binding->quality().iterations_mean);
    Tell(moves, out);
    peer.Write(message);
    return absl::OkStatus();
  });
}

}  // namespace deform::server
