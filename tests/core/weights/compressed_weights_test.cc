// What compressed weights promise, for every scheme.
#include "core/weights/compressed_weights.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>
#include <string>
#include <tuple>
#include <vector>

#include "core/base/error.h"
#include "core/deform/weighted_sums.h"
#include "core/weights/compress_binding.h"
#include "tests/support/ball_request.h"
#include "tests/support/detailed_model.h"
#include "tests/support/shapes.h"

namespace deform {
namespace {

using BindingPtr = std::shared_ptr<const Binding>;

BindingPtr Dense(const BindRequest& request) {
  auto binding = Bind(request, {});
  EXPECT_TRUE(binding.ok()) << binding.status();
  return *binding;
}

BindingPtr Compressed(const Binding& dense, double tolerance,
                      ThreadPool* pool = nullptr) {
  auto binding =
      CompressBinding(dense, &dense.weights(), tolerance, {.pool = pool});
  EXPECT_TRUE(binding.ok()) << binding.status();
  return *binding;
}

// Compares both forms in one pose of the columns after the other.
class BothForms {
 public:
  BothForms(const Binding& dense, const Binding& compressed)
      : dense_(dense),
        compressed_(compressed),
        bounds_(PoseBounds(dense)),
        sums_(WeightedSums::Create(compressed, Unlimited())) {}

  // A component of the largest error, in units of the pose's displacement.
  double Error(const std::vector<double>& displacements) {
    const SumsChange change{
        .sums = sums_.get(), .full = true, .values = displacements};
    ApplyChanges(compressed_, {&change, 1}, nullptr);
    double size = 0, error = 0;
    for (size_t c = 0; c < bounds_.size(); ++c) {
      size = std::max(size, Length(&displacements[c * 3]) / bounds_[c]);
    }
    for (int64_t i = 0; i < dense_.point_count(); ++i) {
      double difference[3];
      sums_->Copy(i, 1, difference);
      for (int64_t c = 0; c < dense_.column_count(); ++c) {
        for (int d = 0; d < 3; ++d) {
          difference[d] -=
              double{dense_.weights().at(i, c)} * displacements[c * 3 + d];
        }
      }
      error = std::max(error, Length(difference));
    }
    return error / size;
  }

  // The signs of a point's errors times R_c: no pose within the bounds is worse
  // for it.
  std::vector<double> WorstPoseOf(int64_t point) {
    const auto columns = dense_.column_count();
    std::vector<float> decompressed(columns);
    compressed_.CopyWeights(point, 1, decompressed.data());
    std::vector<double> pose(columns * 3, 0.0);
    for (int64_t c = 0; c < columns; ++c) {
      const double error =
          double{decompressed[c]} - dense_.weights().at(point, c);
      pose[c * 3] = std::copysign(bounds_[c], error);
    }
    return pose;
  }

  // The point with the largest sum of |error| R_c.
  int64_t WorstPoint() {
    const auto columns = dense_.column_count();
    std::vector<float> row(columns);
    double worst = -1;
    int64_t at = 0;
    for (int64_t i = 0; i < dense_.point_count(); ++i) {
      compressed_.CopyWeights(i, 1, row.data());
      double sum = 0;
      for (int64_t c = 0; c < columns; ++c) {
        sum +=
            std::abs(double{row[c]} - dense_.weights().at(i, c)) * bounds_[c];
      }
      if (sum > worst) {
        worst = sum;
        at = i;
      }
    }
    return at;
  }

  const std::vector<double>& bounds() const { return bounds_; }

 private:
  static double Length(const double* v) { return std::hypot(v[0], v[1], v[2]); }

  const Binding& dense_;
  const Binding& compressed_;
  const std::vector<double> bounds_;
  const std::unique_ptr<WeightedSums> sums_;
};

class CompressedScheme
    : public testing::TestWithParam<std::tuple<const CoordinateScheme*, int>> {
 protected:
  const CoordinateScheme& scheme() const { return *std::get<0>(GetParam()); }
  int dimension() const { return std::get<1>(GetParam()); }
};

TEST_P(CompressedScheme, KeepsItsBoundInEveryPoseThatTriesToBreakIt) {
  const BindingPtr dense = Dense(InBall(scheme(), dimension(), 1500));
  std::mt19937 random(8);
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::uniform_int_distribution<int64_t> any(0, dense->point_count() - 1);
  const int64_t columns = dense->column_count();
  for (const double tolerance : {1e-3, 1e-4, 1e-5, 1e-6}) {
    const BindingPtr compressed = Compressed(*dense, tolerance);
    const double bound = compressed->compressed()->bound();
    // Float sums alone may come to 1e-6 (3 roundings of their terms).
    EXPECT_LE(bound, std::max(tolerance, 2e-6));
    EXPECT_EQ(compressed->compressed()->tolerance(), tolerance);
    BothForms forms(*dense, *compressed);
    EXPECT_LE(forms.Error(forms.WorstPoseOf(forms.WorstPoint())), bound);
    for (int k = 0; k < 20; ++k) {
      EXPECT_LE(forms.Error(forms.WorstPoseOf(any(random))), bound);
      std::vector<double> pose(columns * 3);
      for (int64_t c = 0; c < columns; ++c) {
        for (int d = 0; d < 3; ++d) {
          pose[c * 3 + d] = forms.bounds()[c] * uniform(random);
        }
      }
      EXPECT_LE(forms.Error(pose), bound);
      std::vector<double> one_column(columns * 3, 0.0);
      one_column[k * 7 % columns * 3 + k % 3] = 3;
      EXPECT_LE(forms.Error(one_column), bound);
    }
  }
}

TEST_P(CompressedScheme, ComesWithoutDenseWeightsToTheSameBound) {
  BindRequest request = InBall(scheme(), dimension(), 1500);
  const BindingPtr dense = Dense(request);
  request.weight_tolerance = 1e-4;
  const BindingPtr direct = Dense(request);
  ASSERT_NE(direct->compressed(), nullptr);
  EXPECT_LE(direct->compressed()->bound(), 1e-4);
  BothForms forms(*dense, *direct);
  // Solvers that start from other neighbours end within 1e-12, and blocks of
  // other points may take the path of float where these take double's.
  constexpr double kComputedAgain = 2e-6;
  EXPECT_LE(forms.Error(forms.WorstPoseOf(forms.WorstPoint())),
            1e-4 + kComputedAgain);
}

INSTANTIATE_TEST_SUITE_P(
    All, CompressedScheme,
    testing::Combine(testing::ValuesIn(AllSchemes().begin(),
                                       AllSchemes().end()),
                     testing::Values(2, 3)),
    [](const auto& test) {
      return std::string(std::get<0>(test.param)->id()) +
             std::to_string(std::get<1>(test.param)) + "d";
    });

// 10,802 points in many leaves of four branches, 110 vertices and 216 faces.
BindRequest Detailed() {
  const DetailedModel made = MakeDetailedModel(9, 12, 10);
  return {.model = std::make_shared<const Mesh>(MeshOf(made.model)),
          .rig = CageOf(made.cage),
          .scheme = "green"};
}

TEST(CompressedWeights, TakeAFractionOfTheMemory) {
  // Larger models share their bases among more points, and take less.
  const BindingPtr compressed = Compressed(*Dense(Detailed()), 1e-4);
  const CompressedWeights& weights = *compressed->compressed();
  EXPECT_LT(weights.bytes() * 3, weights.dense_bytes());
  EXPECT_GT(weights.ranks().cluster, weights.ranks().branch);
  EXPECT_GT(weights.ranks().branch, weights.ranks().leaf);
  EXPECT_EQ(compressed->weight_bytes(), weights.bytes());
}

TEST(CompressedWeights, AreTheSameWhateverTheNumberOfThreads) {
  const BindingPtr dense = Dense(Detailed());
  ThreadPool pool({.threads = 4});
  const BindingPtr one = Compressed(*dense, 1e-4);
  const BindingPtr many = Compressed(*dense, 1e-4, &pool);
  EXPECT_EQ(one->compressed()->bound(), many->compressed()->bound());
  EXPECT_EQ(one->weight_bytes(), many->weight_bytes());
  const int64_t numbers = one->point_count() * one->column_count();
  std::vector<float> a(numbers), b(numbers);
  one->CopyWeights(0, one->point_count(), a.data());
  many->CopyWeights(0, many->point_count(), b.data());
  EXPECT_EQ(std::memcmp(a.data(), b.data(), numbers * sizeof(float)), 0);
}

TEST(CompressedWeights, ServePointsThatLeaveThroughAnExitFace) {
  std::mt19937 random(12);
  std::uniform_real_distribution<double> uniform(-2, 2);
  const Positions points =
      Positions::NullaryExpr(2000, 3, [&] { return uniform(random); });
  BindRequest request{.model = std::make_shared<const Mesh>(
                          *Mesh::Create(3, points, Faces(0, 3))),
                      .rig = CageOf(Icosphere(1, 1)),
                      .scheme = "green",
                      .exits = {.kind = ExitRegions::Kind::kAutomatic}};
  const BindingPtr dense = Dense(request);
  ASSERT_FALSE(dense->exit_parts().empty());
  const BindingPtr compressed = Compressed(*dense, 1e-4);
  request.weight_tolerance = 1e-4;
  const BindingPtr direct = Dense(request);
  for (const BindingPtr& binding : {compressed, direct}) {
    EXPECT_LE(binding->compressed()->bound(), 1e-4);
    BothForms forms(*dense, *binding);
    EXPECT_LE(forms.Error(forms.WorstPoseOf(forms.WorstPoint())),
              1e-4 + 2e-6);  // As above, for those computed again.
  }
}

TEST(CompressedWeights, AreZeroForPointsWithoutWeights) {
  BindRequest request = InBall(*AllSchemes()[0], 3, 500);
  Positions points = request.model->positions();
  points.row(17) << 5, 0, 0;
  request.model =
      std::make_shared<const Mesh>(*Mesh::Create(3, points, Faces(0, 3)));
  request.unbindable = Unbindable::kReport;
  const BindingPtr dense = Dense(request);
  const BindingPtr compressed = Compressed(*dense, 1e-4);
  EXPECT_EQ(compressed->compressed()->slot(17), -1);
  std::vector<float> row(dense->column_count(), 1.0F);
  compressed->CopyWeights(17, 1, row.data());
  EXPECT_EQ(row, std::vector<float>(row.size(), 0.0F));
  compressed->CopyWeights(16, 1, row.data());
  EXPECT_NE(row, std::vector<float>(row.size(), 0.0F));
}

TEST(CompressedWeights, MayServeNobody) {
  BindRequest request = InBall(*AllSchemes()[0], 3, 40);
  request.model = std::make_shared<const Mesh>(
      *Mesh::Create(3, request.model->positions().array() + 10, Faces(0, 3)));
  request.unbindable = Unbindable::kReport;
  const BindingPtr compressed = Compressed(*Dense(request), 1e-4);
  EXPECT_EQ(compressed->compressed()->slot_count(), 0);
  EXPECT_EQ(compressed->compressed()->bound(), 0);
  std::vector<float> row(compressed->column_count(), 1.0F);
  compressed->CopyWeights(3, 1, row.data());
  EXPECT_EQ(row, std::vector<float>(row.size(), 0.0F));
}

TEST(CompressedWeights, CanBeCancelled) {
  Cancellation cancellation;
  cancellation.Cancel();
  const BindingPtr dense = Dense(InBall(*AllSchemes()[0], 3, 100));
  const auto outcome = CompressBinding(*dense, &dense->weights(), 1e-4,
                                       {.cancellation = &cancellation});
  EXPECT_EQ(outcome.status().code(), absl::StatusCode::kCancelled);
}

TEST(CompressedWeights, AreGivenUpOnceTheyTakeMoreThanTheyMay) {
  const BindingPtr dense = Dense(InBall(*AllSchemes()[0], 3, 5000));
  const int64_t bytes = Compressed(*dense, 1e-4)->compressed()->bytes();
  std::atomic<int64_t> done = 0;
  const auto fits =
      CompressBinding(*dense, &dense->weights(), 1e-4,
                      {.points_done = &done, .max_weight_bytes = bytes});
  EXPECT_TRUE(fits.ok()) << fits.status();
  EXPECT_EQ(done, 5000);
  const auto outcome = CompressBinding(*dense, &dense->weights(), 1e-4,
                                       {.max_weight_bytes = bytes / 2});
  EXPECT_EQ(outcome.status().code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(DetailOf(outcome.status()).reason, "NOT_SMALLER");
  EXPECT_EQ(outcome.status().message(),
            "compressed weights would take more than " +
                std::to_string(bytes / 2) + " bytes");
}

TEST(CompressedWeights, RefuseAToleranceOutOfRange) {
  BindRequest request = InBall(*AllSchemes()[0], 3, 10);
  for (const double tolerance : {-1.0, 1e-7, 0.02, std::nan("")}) {
    request.weight_tolerance = tolerance;
    const absl::Status status = Bind(request, {}).status();
    EXPECT_EQ(DetailOf(status).reason, "WEIGHT_TOLERANCE_OUT_OF_RANGE");
    EXPECT_EQ(DetailOf(status).field, "weight_tolerance");
    EXPECT_THAT(
        std::string(status.message()),
        testing::StartsWith("weight tolerance must be 0 (dense weights) "
                            "or in [1e-06, 0.01], not "));
  }
}

}  // namespace
}  // namespace deform
