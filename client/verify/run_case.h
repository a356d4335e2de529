// Takes a reference case through a live server.
#pragma once

#include <memory>
#include <set>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "client/cpp/client.h"
#include "client/verify/golden_case.h"
#include "client/verify/judge.h"
#include "core/base/mutex.h"

namespace deform {

// Remembers what was made on the server, to be deleted at the end: cases that
// share a model or a binding must not take it from each other. Thread-safe.
class CreatedThings {
 public:
  // What existed before belongs to someone else and is left alone.
  void Add(const ModelInfo& model);
  void Add(const BindingInfo& binding);

  // Deletes bindings, then models. Returns the first error, but goes on.
  absl::Status DeleteAll(Client& client);

 private:
  Mutex mutex_;
  std::set<std::string> models_ ABSL_GUARDED_BY(mutex_);
  std::set<std::string> bindings_ ABSL_GUARDED_BY(mutex_);
};

// "EXTERIOR_NO_EXIT_FACE" as case files call it: "exterior_no_exit_face".
std::string GoldenErrorName(absl::string_view reason);

// Registers the points, binds them with unbindable points reported, fetches the
// weights in double and poses a session. What the server refuses becomes the
// error of every query it is about. An error of this function means that the
// case could not be run: the server is gone or answers what makes no sense.
absl::StatusOr<CaseResult> RunCase(Client& client, const GoldenCase& golden,
                                   CreatedThings& created);

}  // namespace deform
