#include "tests/bench/goals.h"

#include <string>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace deform::bench {
namespace {

const char kLarge[] = "deform 173K x 326/";
const char kDense[] = "deform 173K x 326/this, dense, 1 core";

class Goals {
 public:
  explicit Goals(const std::vector<Row>& rows) : rows_(rows) {}

  // Null if it was not measured.
  const Row* Find(const std::string& name) const {
    for (const Row& row : rows_) {
      if (row.name == name) return &row;
    }
    return nullptr;
  }
  // How many times as fast as `slow` is `fast`?
  void Faster(const std::string& fast, const std::string& slow,
              double at_least) const {
    const Row *a = Find(fast), *b = Find(slow);
    if (a == nullptr || b == nullptr) return;
    const auto last = [](const std::string& name) {
      return name.substr(name.rfind('/') + 1);
    };
    Print(absl::StrCat(fast, " : ", last(slow)), b->seconds / a->seconds,
          at_least, true);
  }
  void Smaller(const std::string& small, const std::string& large,
               double at_least) const {
    const Row *a = Find(small), *b = Find(large);
    if (a == nullptr || b == nullptr || !a->megabytes || !b->megabytes) return;
    Print(absl::StrCat(small, ": memory, dense"), *b->megabytes / *a->megabytes,
          at_least, true);
  }
  void Print(const std::string& what, double value, double wanted,
             bool at_least) const {
    const bool met = at_least ? value >= wanted : value <= wanted;
    absl::PrintF("%-84s %10.3g  %s %-8.3g %s\n", what, value,
                 at_least ? ">=" : "<=", wanted, met ? "" : "MISSED");
  }
  void Error(const std::string& name, double at_most) const {
    const Row* row = Find(name);
    if (row == nullptr || !row->error) return;
    Print(absl::StrCat(name, ": error"), *row->error, at_most, false);
  }
  const std::vector<Row>& rows() const { return rows_; }

 private:
  const std::vector<Row>& rows_;
};

void OfWeights(const Goals& goals) {
  const std::string scene = "weights Green 3D/";
  goals.Faster(scene + "lanes in float", scene + "plain closed form", 10);
  goals.Faster(scene + "lanes in float", scene + "[L08] Algorithm 2", 300);
  goals.Error(scene + "lanes in float", 1e-6);
  goals.Error(scene + "lanes in double", 1e-12);
}

void OfDense(const Goals& goals) {
  const std::string large = kLarge;
  goals.Faster(kDense, large + "Eigen float, 1 core", 2.2);
  if (const Row* row = goals.Find(kDense); row != nullptr && row->to_limit) {
    goals.Print(absl::StrCat(kDense, " : read limit"), *row->to_limit, 0.85,
                true);
  }
  const Row* one = goals.Find(large + "this, K = 1, a session, 1 core");
  const Row* eight = goals.Find(large + "this, K = 8, a session, 1 core");
  if (one != nullptr && eight != nullptr) {
    goals.Print(eight->name + " : K = 1", eight->seconds / one->seconds, 0.35,
                false);
  }
}

// Deltas tell their limit: their share of the columns times the dense pass.
void OfDeltas(const Goals& goals) {
  for (const Row& row : goals.rows()) {
    if (!row.to_limit || row.name.find(kLarge) != 0) continue;
    for (const char* share : {"delta 5 %", "delta 10 %", "delta 25 %"}) {
      if (row.name.find(share) == std::string::npos ||
          row.name.find("drag") == std::string::npos) {
        continue;
      }
      goals.Print(absl::StrCat(row.name, " : share x dense"), 1 / *row.to_limit,
                  1.3, false);
    }
  }
}

void OfCompressed(const Goals& goals) {
  struct Claim {
    const char* scene;
    const char* form;
    double speed;
    double memory;
  };
  for (const Claim& claim :
       {Claim{"deform 173K x 326", "1e-04", 10, 12},
        Claim{"deform 173K x 326", "1e-05", 6, 8},
        Claim{"deform 173K x 100 handles", "1e-05", 4, 1}}) {
    const std::string form = absl::StrCat(claim.scene, "/this, compressed to ",
                                          claim.form, ", 1 core");
    const std::string dense = absl::StrCat(claim.scene, "/this, dense, 1 core");
    goals.Faster(form, dense, claim.speed);
    if (claim.memory > 1) goals.Smaller(form, dense, claim.memory);
  }
}

// No kernel is slower than the plain one: the row that comes nearest to it.
void OfAll(const Goals& goals) {
  const Row* nearest = nullptr;
  for (const Row& row : goals.rows()) {
    const bool ours = row.name.find("/this") != std::string::npos ||
                      row.name.find("/lanes") != std::string::npos;
    // Those of all cores pass time with others.
    if (!ours || !row.to_naive ||
        row.name.find("all cores") != std::string::npos) {
      continue;
    }
    if (nearest == nullptr || *row.to_naive < *nearest->to_naive) {
      nearest = &row;
    }
  }
  if (nearest != nullptr) {
    goals.Print(absl::StrCat("slowest against plain: ", nearest->name),
                *nearest->to_naive, 1, true);
  }
}

}  // namespace

void PrintGoals(const std::vector<Row>& rows) {
  const Goals goals(rows);
  absl::PrintF("\n%-84s %10s  %s\n", "ratio", "measured", "wanted");
  OfWeights(goals);
  OfDense(goals);
  OfDeltas(goals);
  OfCompressed(goals);
  OfAll(goals);
}

}  // namespace deform::bench
