// Stores as they are used: steps, at random or by a script, and what should be
// true after them.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "server/stores/store.h"

namespace deform::server {

struct Step {
  enum class Kind {
    kPutModel,
    kPutBinding,
    kPutWeights,
    kPutSession,
    kWhole,
    kPart,
    kMoveRig,
    kTakeOver,
    kDeleteSession,
    kDeleteBinding,
    kDeleteModel,
    kCollectOrphans,
  };
  Kind kind = Kind::kPutModel;
  int id = 0;     // Of a few models, bindings or sessions.
  int value = 0;  // What is put; of sessions and moves, the binding.
};

// One of each kind, and more poses, so that every call of a store is made.
std::vector<Step> Script();
Step RandomStep(std::mt19937_64& random);

// What a store should hold: the plainest that can be said.
class Reference {
 public:
  // The append that the step makes now.
  PoseAppend Appended(const Step& step) const;
  // Whether the step succeeds where nothing fails; then it has happened. If
  // not, nothing has, but that a session may take a whole pose next.
  bool Apply(const Step& step);
  // The step was refused by a disk: a session takes a whole pose next.
  void Fail(const Step& step);
  // A new server reads what is stored, and goes on from there.
  void Reopen();
  // A line for each thing.
  std::string Describe() const;

 private:
  struct Session {
    int binding = 0;
    uint64_t epoch = 1;
    uint64_t revision = 0;
    bool needs_whole = true;
    std::vector<double> rows;
  };
  void DropUnbound();

  std::map<int, int> bindings_;  // To the version of their weights; 0: none.
  std::vector<bool> models_ = std::vector<bool>(2);
  std::map<int, Session> sessions_;
};

// Does the step; appends are waited for.
absl::Status Do(const Step& step, const Reference& before, Store& store);
// As Reference::Describe() would have it; what is damaged has another line.
std::string Describe(Store& store);

}  // namespace deform::server
