// What a stream makes frames of that bring no positions.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "client/cpp/deform_stream.h"
#include "core/deform/deformer.h"
#include "core/frames/leaf_basis.h"

namespace deform {

// The weights of the binding that frames are of, and of one that they may be of
// next; likewise leaf bases. Not thread-safe.
class HeldWeights {
 public:
  // `pool` is borrowed, and may be null.
  explicit HeldWeights(ThreadPool* pool = nullptr) : pool_(pool) {}

  // In place of others that are not `present`.
  void Add(const HeldBinding& weights, const std::string& present);
  // In place of the last but one.
  void Add(HeldBasis basis);
  // Null if there are none of this binding.
  Deformer* Find(const std::string& binding_id) const;
  // Null if there is no such basis.
  const LeafBasis* FindBasis(const std::string& basis_id) const;
  ThreadPool* pool() const { return pool_; }

  // InvalidArgument OTHER_MODEL unless they can be of this session.
  static absl::Status Check(const HeldBinding& weights,
                            const JoinedSession& session);
  static absl::Status Check(const HeldBasis& basis,
                            const JoinedSession& session);

 private:
  ThreadPool* pool_;
  std::map<std::string, std::unique_ptr<Deformer>> deformers_;
  std::vector<HeldBasis> bases_;  // Two at most, the newest last.
};

}  // namespace deform
