#include <memory>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/weights/blocks.h"
#include "core/weights/schemes/celestial_evaluator.h"
#include "tests/bench/benches.h"
#include "tests/bench/contest.h"
#include "tests/bench/scenes.h"
#include "tests/bench/weights_measure.h"

namespace deform::bench {
namespace {

void AddCageRows(const WeightsScene& scene, const AddRow& add) {
  const std::vector<WeightsResult> results = MeasureWeights(scene);
  for (const WeightsResult& result : results) {
    const double seconds = result.seconds_per_point_and_face;
    add({.name = absl::StrCat("weights ", scene.name, "/", result.way),
         .seconds = seconds,
         .rate = 1 / seconds,
         .unit = "points x faces/s",
         .to_naive = results.front().seconds_per_point_and_face / seconds,
         .error = result.error});
  }
}

// One scheme of free handles, in blocks as Bind() cuts them.
class CelestialContest {
 public:
  CelestialContest(CelestialKind kind, int64_t handles, int64_t points)
      : points_(OrganPoints(points)), handles_(handles) {
    const Handles around = HandlesAround(handles);
    const auto make = [&](CelestialWay way) {
      return MakeCelestialEvaluator(kind, around, {}, way);
    };
    plain_ = make(CelestialWay::kPlain);
    lanes_ = make(CelestialWay::kLanes);
  }

  void Run(const std::string& scene, const Settings& settings,
           const AddRow& add) {
    const auto count = static_cast<double>(points_.rows());
    contest_.Add(
        "plain", [this] { EvaluateAll(*plain_, plain_block_); }, count);
    contest_.Add(
        "lanes in double", [this] { EvaluateAll(*lanes_, block_); }, count);
    contest_.Run(3, settings.Seconds(1));
    for (const std::string& name : contest_.Names()) {
      const double seconds = contest_.Best(name);
      add({.name = absl::StrCat(scene, "/", name),
           .seconds = seconds,
           .rate = 1 / seconds,
           .unit = "points/s",
           .to_naive = contest_.Best("plain") / seconds,
           // Of the last block.
           .error = name == "plain" ? 0
                                    : (block_.vertex - plain_block_.vertex)
                                          .cwiseAbs()
                                          .maxCoeff()});
    }
  }

 private:
  void EvaluateAll(const WeightEvaluator& evaluator, WeightBlock& block) const {
    const int64_t n = points_.rows(), step = BlockPoints(handles_);
    for (int64_t b = 0; b * step < n; ++b) {
      const Block at = BlockAt(b, step, n);
      evaluator.Evaluate(points_.middleRows(at.first, at.count), block);
    }
  }

  const Positions points_;
  const int64_t handles_;
  std::unique_ptr<const WeightEvaluator> plain_, lanes_;
  WeightBlock plain_block_, block_;
  Contest contest_;
};

}  // namespace

void MeasureWeightRows(const Settings& settings, const AddRow& add) {
  const int64_t points = settings.Points(settings.quick ? 4096 : 65'536);
  for (const WeightsScene& scene : WeightsScenes(points)) {
    if (settings.Wants("weights " + scene.name)) AddCageRows(scene, add);
  }
  struct Kind {
    const char* name;
    CelestialKind kind;
  };
  for (const Kind& kind : {Kind{"S-CC", CelestialKind::kScaling},
                           Kind{"T-CC", CelestialKind::kTranslation}}) {
    for (const int64_t handles : {30, 100}) {
      const std::string scene =
          absl::StrCat("weights ", kind.name, ", ", handles, " handles");
      if (!settings.Wants(scene)) continue;
      CelestialContest(kind.kind, handles, points / 2)
          .Run(scene, settings, add);
    }
  }
}

}  // namespace deform::bench
