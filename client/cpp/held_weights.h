// What a stream deforms poses with.
#pragma once

#include <map>
#include <memory>
#include <string>

#include "absl/status/status.h"
#include "client/cpp/deform_stream.h"
#include "core/deform/deformer.h"

namespace deform {

// The weights of the binding that frames are of, and of one that they may be of
// next. Not thread-safe.
class HeldWeights {
 public:
  // `pool` is borrowed, and may be null.
  explicit HeldWeights(ThreadPool* pool = nullptr) : pool_(pool) {}

  // In place of others that are not `present`.
  void Add(const HeldBinding& weights, const std::string& present);
  // Null if there are none of this binding.
  Deformer* Find(const std::string& binding_id) const;

  // InvalidArgument OTHER_MODEL unless they can be of this session.
  static absl::Status Check(const HeldBinding& weights,
                            const JoinedSession& session);

 private:
  ThreadPool* pool_;
  std::map<std::string, std::unique_ptr<Deformer>> deformers_;
};

}  // namespace deform
