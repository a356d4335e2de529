#include "tests/bench/weights_measure.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "core/mesh/mesh.h"
#include "core/mesh/rig.h"
#include "core/weights/binding.h"
#include "core/weights/blocks.h"
#include "core/weights/schemes/green.h"
#include "core/weights/schemes/mean_value.h"
#include "tests/bench/baselines/green_algorithm2.h"
#include "tests/bench/scenes.h"
#include "tests/bench/timing.h"

namespace deform::bench {
namespace {

constexpr int kRounds = 4;
constexpr int kPasses = 2;  // In a round.
constexpr int64_t kAlgorithm2Points = 100;

// All points of a scene, in blocks as Bind() cuts them.
class Measurement {
 public:
  explicit Measurement(const WeightsScene& scene)
      : scene_(scene),
        plain_(scene.make(scene.cage, Way::kPlain)),
        lanes_(scene.make(scene.cage, Way::kLanes)) {
    plain_->Evaluate(scene.points, exact_);
  }

  WeightsResult Plain() const {
    return {"plain closed form", EvaluateAll(*plain_), 0};
  }

  WeightsResult InDouble() const {
    WeightBlock block;
    lanes_->Evaluate(scene_.points, block);
    return {"lanes in double", EvaluateAll(*lanes_),
            Error([&](int64_t i, int64_t c) {
              return c < vertices() ? block.vertex(i, c)
                                    : block.normal(i, c - vertices());
            })};
  }

  WeightsResult InFloat() const {
    WeightTiles tiles(scene_.points.rows(), columns());
    const double seconds = Best([&](Block at) {
      TileBlock block{.tiles = tiles.tile(at.first / kTilePoints)};
      lanes_->EvaluateTiles(scene_.points.middleRows(at.first, at.count),
                            block);
    });
    return {"lanes in float", seconds, ErrorOf(tiles)};
  }

  WeightsResult Whole() const {
    const BindRequest request = {
        .model = std::make_shared<const Mesh>(
            Mesh::Create(scene_.cage.dimension(), scene_.points, Faces(0, 3))
                .value()),
        .rig = scene_.cage,
        .scheme = scene_.scheme};
    std::shared_ptr<const Binding> binding;
    const double seconds =
        BestCpuSeconds(kPasses, [&] { binding = Bind(request, {}).value(); });
    return {"Bind()", seconds / work(), ErrorOf(binding->weights())};
  }

  WeightsResult Algorithm2() const {
    const int64_t n = std::min(kAlgorithm2Points, scene_.points.rows());
    RowMatrix phi(n, vertices()), psi(n, columns() - vertices());
    const double seconds = BestCpuSeconds(kPasses, [&] {
      for (int64_t i = 0; i < n; ++i) {
        GreenAlgorithm2(scene_.cage, scene_.points.row(i),
                        {&phi(i, 0), static_cast<size_t>(phi.cols())},
                        {&psi(i, 0), static_cast<size_t>(psi.cols())});
      }
    });
    const double error = std::max(
        (phi - exact_.vertex.topRows(n)).cwiseAbs().maxCoeff(),
        (psi - exact_.normal.topRows(n)).cwiseAbs().maxCoeff() / diagonal());
    return {"[L08] Algorithm 2", seconds * scene_.points.rows() / n / work(),
            error};
  }

 private:
  int64_t vertices() const { return exact_.vertex.cols(); }
  int64_t columns() const { return vertices() + exact_.normal.cols(); }
  double diagonal() const { return DiagonalOf(scene_.cage); }
  double work() const {
    return static_cast<double>(scene_.points.rows() * scene_.cage.face_count());
  }

  template <typename Body>
  double Best(Body body) const {
    const int64_t n = scene_.points.rows(), step = BlockPoints(columns());
    return BestCpuSeconds(kPasses,
                          [&] {
                            for (int64_t b = 0; b * step < n; ++b)
                              body(BlockAt(b, step, n));
                          }) /
           work();
  }
  double EvaluateAll(const LaneEvaluator& evaluator) const {
    WeightBlock block;
    return Best([&](Block at) {
      evaluator.Evaluate(scene_.points.middleRows(at.first, at.count), block);
    });
  }

  template <typename Weight>
  double Error(Weight weight) const {
    double error = 0;
    for (int64_t i = 0; i < scene_.points.rows(); ++i) {
      for (int64_t c = 0; c < columns(); ++c) {
        const double off =
            c < vertices() ? weight(i, c) - exact_.vertex(i, c)
                           : (weight(i, c) - exact_.normal(i, c - vertices())) /
                                 diagonal();
        error = std::max(error, std::isnan(off) ? HUGE_VAL : std::abs(off));
      }
    }
    return error;
  }
  double ErrorOf(const WeightTiles& tiles) const {
    return Error([&](int64_t i, int64_t c) { return tiles.at(i, c); });
  }

  const WeightsScene& scene_;
  const std::unique_ptr<const LaneEvaluator> plain_, lanes_;
  WeightBlock exact_;
};

}  // namespace

std::vector<WeightsResult> MeasureWeights(const WeightsScene& scene) {
  const Measurement measurement(scene);
  std::vector<WeightsResult> best;
  // In turns: what else the machine does hits all alike.
  for (int round = 0; round < kRounds; ++round) {
    std::vector<WeightsResult> results = {
        measurement.Plain(), measurement.InDouble(), measurement.InFloat(),
        measurement.Whole()};
    if (scene.scheme == "green" && scene.cage.dimension() == 3) {
      results.push_back(measurement.Algorithm2());
    }
    if (best.empty()) best = results;
    for (size_t i = 0; i < best.size(); ++i) {
      best[i].seconds_per_point_and_face =
          std::min(best[i].seconds_per_point_and_face,
                   results[i].seconds_per_point_and_face);
    }
  }
  return best;
}

std::vector<WeightsScene> WeightsScenes(int64_t points) {
  const Cage organ = OrganCage(9, 12), leaf = LeafCage(40);
  return {
      {"Green 3D", "green", MakeGreenEvaluator, organ, OrganPoints(points)},
      {"Green 3D, 100 points", "green", MakeGreenEvaluator, organ,
       OrganPoints(100)},
      {"Green 3D, 100 points, 8/12", "green", MakeGreenEvaluator,
       OrganCage(2, 3), 0.4 * OrganPoints(100)},
      {"Mean value 3D", "mean_value", MakeMeanValueEvaluator, organ,
       OrganPoints(points / 2)},
      {"Green 2D", "green", MakeGreenEvaluator, leaf, LeafPoints(points)},
      {"Mean value 2D", "mean_value", MakeMeanValueEvaluator, leaf,
       LeafPoints(points)},
      {"Mean value 2D, 100 points", "mean_value", MakeMeanValueEvaluator, leaf,
       LeafPoints(100)},
  };
}

}  // namespace deform::bench
