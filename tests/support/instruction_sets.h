// Running code of Highway on one instruction set after the other.
#pragma once

#include <cstdint>

#include <hwy/targets.h>

namespace deform {

// While it lives, dynamic dispatch goes to `target`, one of
// hwy::SupportedAndGeneratedTargets(); then to the best again.
class OnInstructionSet {
 public:
  explicit OnInstructionSet(int64_t target) { Choose(target); }
  ~OnInstructionSet() { Choose(0); }
  OnInstructionSet(const OnInstructionSet&) = delete;
  OnInstructionSet& operator=(const OnInstructionSet&) = delete;

 private:
  static void Choose(int64_t target) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  }
};

}  // namespace deform
