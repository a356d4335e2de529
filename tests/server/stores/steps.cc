#include "tests/server/stores/steps.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "tests/server/stores/samples.h"

namespace deform::server {
namespace {

using Kind = Step::Kind;

constexpr int kModels = 2;
constexpr int kBindings = 3;
constexpr int kSessions = 3;
constexpr int kRows = 3;

StoreKey ModelKey(int id) { return Key(absl::StrCat("m", id)); }
StoreKey BindingKey(int id) { return Key(absl::StrCat("b", id)); }
StoreKey SessionKey(int id) { return Key(absl::StrCat("s", id)); }
// The model of a binding never changes.
int ModelOfBinding(int binding) { return binding % kModels; }

bool IsAppend(const Step& step) {
  return step.kind == Kind::kWhole || step.kind == Kind::kPart ||
         step.kind == Kind::kMoveRig;
}

}  // namespace

std::vector<Step> Script() {
  return {{Kind::kPutModel, 0},      {Kind::kPutBinding, 0},
          {Kind::kPutWeights, 0, 1}, {Kind::kPutSession, 0, 0},
          {Kind::kWhole, 0, 1},      {Kind::kPart, 0, 2},
          {Kind::kPart, 0, 3},       {Kind::kPutBinding, 2},
          {Kind::kMoveRig, 0, 2},    {Kind::kTakeOver, 0},
          {Kind::kWhole, 0, 4},      {Kind::kPart, 0, 5},
          {Kind::kPart, 0, 6},       {Kind::kPart, 0, 7},
          {Kind::kPutWeights, 0, 2}, {Kind::kPutSession, 1, 0},
          {Kind::kDeleteSession, 1}, {Kind::kPutSession, 1, 0},
          {Kind::kPutModel, 1},      {Kind::kPutBinding, 1},
          {Kind::kPutWeights, 1, 1}, {Kind::kDeleteBinding, 0},
          {Kind::kDeleteModel, 1},   {Kind::kCollectOrphans},
          {Kind::kWhole, 0, 8}};
}

Step RandomStep(std::mt19937_64& random) {
  // What makes things is more frequent than what takes them away.
  static const auto& kinds = *new std::vector<Kind>{
      Kind::kPutModel,      Kind::kPutModel,    Kind::kPutBinding,
      Kind::kPutBinding,    Kind::kPutWeights,  Kind::kPutWeights,
      Kind::kPutSession,    Kind::kPutSession,  Kind::kPutSession,
      Kind::kWhole,         Kind::kWhole,       Kind::kWhole,
      Kind::kPart,          Kind::kPart,        Kind::kPart,
      Kind::kPart,          Kind::kPart,        Kind::kPart,
      Kind::kMoveRig,       Kind::kTakeOver,    Kind::kDeleteSession,
      Kind::kDeleteBinding, Kind::kDeleteModel, Kind::kCollectOrphans};
  Step step{.kind = kinds[random() % kinds.size()]};
  step.id = static_cast<int>(random() % kSessions);
  if (step.kind == Kind::kPutModel || step.kind == Kind::kDeleteModel) {
    step.id %= kModels;
  }
  step.value = 1 + static_cast<int>(random() % 100);
  if (step.kind == Kind::kPutSession || step.kind == Kind::kMoveRig) {
    step.value %= kBindings;
  }
  return step;
}

PoseAppend Reference::Appended(const Step& step) const {
  const auto found = sessions_.find(step.id);
  const Session session = found == sessions_.end() ? Session() : found->second;
  const StoreKey key = SessionKey(step.id);
  if (step.kind == Kind::kPart) {
    return Part(key, session.revision + 1, step.value % kRows, step.value,
                session.epoch);
  }
  PoseAppend whole =
      Whole(key, session.revision + 1, step.value, kRows, session.epoch);
  if (step.kind == Kind::kMoveRig) {
    whole.binding_id = BindingKey(step.value).id;
  }
  return whole;
}

bool Reference::Apply(const Step& step) {
  const auto binding = bindings_.find(step.id);
  const auto session = sessions_.find(step.id);
  const bool has_model = models_[static_cast<size_t>(step.id % kModels)];
  switch (step.kind) {
    case Kind::kPutModel:
      models_[static_cast<size_t>(step.id)] = true;
      return true;
    case Kind::kDeleteModel:
      models_[static_cast<size_t>(step.id)] = false;
      std::erase_if(bindings_, [&](const auto& entry) {
        return ModelOfBinding(entry.first) == step.id;
      });
      DropUnbound();
      return has_model;
    case Kind::kPutBinding:
      if (has_model) bindings_.emplace(step.id, 0);
      return has_model;
    case Kind::kPutWeights:
      if (binding == bindings_.end()) return false;
      binding->second = step.value;
      return true;
    case Kind::kDeleteBinding:
      if (bindings_.erase(step.id) == 0) return false;
      DropUnbound();
      return true;
    case Kind::kPutSession:
      return bindings_.contains(step.value) &&
             sessions_.emplace(step.id, Session{.binding = step.value}).second;
    case Kind::kDeleteSession:
      return sessions_.erase(step.id) > 0;
    case Kind::kCollectOrphans:
      return true;
    default:
      break;
  }
  if (session == sessions_.end()) return false;
  Session& state = session->second;
  if (step.kind == Kind::kTakeOver) {
    ++state.epoch;
    state.needs_whole = true;
    return true;
  }
  if (step.kind == Kind::kPart) {
    if (state.needs_whole) return false;
    state.rows[static_cast<size_t>(step.value % kRows)] = step.value;
  } else {
    if (step.kind == Kind::kMoveRig) {
      if (!bindings_.contains(step.value)) {
        // Found out when it was accepted already.
        state.needs_whole = true;
        return false;
      }
      state.binding = step.value;
    }
    state.rows.assign(kRows, step.value);
    state.needs_whole = false;
  }
  ++state.revision;
  return true;
}

void Reference::Fail(const Step& step) {
  const auto session = sessions_.find(step.id);
  if (IsAppend(step) && session != sessions_.end()) {
    session->second.needs_whole = true;
  }
}

void Reference::Reopen() {
  for (auto& [id, session] : sessions_) {
    session.needs_whole = session.rows.empty();
  }
}

void Reference::DropUnbound() {
  std::erase_if(sessions_, [&](const auto& entry) {
    return !bindings_.contains(entry.second.binding);
  });
}

std::string Reference::Describe() const {
  std::string text;
  for (int id = 0; id < kModels; ++id) {
    if (models_[static_cast<size_t>(id)]) {
      absl::StrAppend(&text, "model m", id, " mesh m", id, "\n");
    }
  }
  for (const auto& [id, weights] : bindings_) {
    absl::StrAppend(&text, "binding b", id, " of m", ModelOfBinding(id),
                    " weights ", weights, "\n");
  }
  for (const auto& [id, session] : sessions_) {
    absl::StrAppend(&text, "session s", id, " on b", session.binding, " epoch ",
                    session.epoch, " revision ", session.revision, " at ",
                    absl::StrJoin(session.rows, ","), "\n");
  }
  return text;
}

absl::Status Do(const Step& step, const Reference& before, Store& store) {
  switch (step.kind) {
    case Kind::kPutModel: {
      const StoreKey key = ModelKey(step.id);
      return store.PutModel(ModelOf(key), ArraysOf("mesh " + key.id));
    }
    case Kind::kDeleteModel:
      return store.DeleteModel(ModelKey(step.id));
    case Kind::kPutBinding:
      return store.PutBinding(
          BindingOf(BindingKey(step.id), ModelKey(ModelOfBinding(step.id)).id));
    case Kind::kPutWeights:
      return store.PutWeights(BindingKey(step.id),
                              {"tiles", static_cast<uint32_t>(step.value)},
                              ArraysOf(absl::StrCat(step.value)));
    case Kind::kDeleteBinding:
      return store.DeleteBinding(BindingKey(step.id));
    case Kind::kPutSession:
      return store.PutSession(
          SessionOf(SessionKey(step.id), BindingKey(step.value).id));
    case Kind::kDeleteSession:
      return store.DeleteSession(SessionKey(step.id));
    case Kind::kTakeOver: {
      const std::vector<StoreKey> key = {SessionKey(step.id)};
      return store.TakeOver(key).status();
    }
    case Kind::kCollectOrphans:
      return store.CollectOrphans().status();
    default:
      break;
  }
  absl::Status told = absl::InternalError("not told");
  const absl::Status accepted =
      store.Append(before.Appended(step),
                   [&told](const absl::Status& status) { told = status; });
  if (!accepted.ok()) return accepted;
  store.Sync().IgnoreError();
  return told;
}

std::string Describe(Store& store) {
  const auto contents = store.Load();
  if (!contents.ok()) return absl::StrCat(contents.status().ToString(), "\n");
  std::string text;
  for (const absl::Status& damage : contents->damaged) {
    absl::StrAppend(&text, damage.ToString(), "\n");
  }
  for (const StoredModel& model : contents->models) {
    const auto arrays = store.ModelArrays(model.key);
    absl::StrAppend(&text, "model ", model.key.id, " ",
                    arrays.ok() ? TextOf(*arrays) : arrays.status().ToString(),
                    "\n");
  }
  for (const StoredBinding& binding : contents->bindings) {
    const auto weights = store.Weights(binding.key);
    const std::string held =
        weights.ok() ? TextOf(weights->arrays)
        : ReasonOf(weights.status()) == "WEIGHTS_NOT_STORED"
            ? "0"
            : weights.status().ToString();
    absl::StrAppend(&text, "binding ", binding.key.id, " of ", binding.model_id,
                    " weights ", held, "\n");
  }
  for (const StoredSession& session : contents->sessions) {
    const auto pose = store.LoadSession(session.key);
    if (!pose.ok()) {
      absl::StrAppend(&text, pose.status().ToString(), "\n");
      continue;
    }
    std::vector<double> rows;
    for (Eigen::Index i = 0; i < pose->pose.vertices.rows(); ++i) {
      rows.push_back(pose->pose.vertices(i, 2));
    }
    absl::StrAppend(&text, "session ", session.key.id, " on ", pose->binding_id,
                    " epoch ", pose->epoch, " revision ", pose->revision,
                    " at ", absl::StrJoin(rows, ","), "\n");
  }
  return text;
}

}  // namespace deform::server
