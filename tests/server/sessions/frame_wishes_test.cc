#include "server/sessions/frame_wishes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "core/base/error.h"
#include "core/base/status_macros.h"
#include "tests/server/sessions/support.h"

namespace deform::server {
namespace {

using testing::HasSubstr;

const FrameEncoding* const kFloat32 = FindEncoding("float32");
const FrameEncoding* const kQuantized16 = FindEncoding("quantized16");
const FrameEncoding* const kPredicted = FindEncoding("predicted");
// Of the cube.
const double kDiagonal = std::sqrt(12.0);

absl::StatusOr<FrameFormat> Pick(const FrameWishes& wishes) {
  DEFORM_ASSIGN_OR_RETURN(const FrameFormats formats,
                          PickFormats(wishes, Rig(BallCage())));
  return formats.format;
}

TEST(PickFormat, Float32NeedsNoWords) {
  const FrameFormat format = Pick({}).value();
  EXPECT_EQ(format.encoding, kFloat32);
  EXPECT_EQ(format.tolerance, 0);
}

TEST(PickFormat, TakesTheFirst) {
  const FrameFormat format =
      Pick({.encodings = {kQuantized16, kPredicted}, .tolerance = 0.01})
          .value();
  EXPECT_EQ(format.encoding, kQuantized16);
  EXPECT_EQ(format.tolerance, 0.01);
}

TEST(PickFormat, AToleranceMayBeAFractionOfTheDiagonal) {
  const FrameFormat format =
      Pick({.encodings = {kPredicted}, .tolerance_fraction = 1e-5}).value();
  EXPECT_DOUBLE_EQ(format.tolerance, 1e-5 * kDiagonal);
}

TEST(PickFormat, PassesOverWhatCannotKeepTheTolerance) {
  // 16 bits of a cube of side 2 are good for 2.7e-5.
  const FrameFormat format =
      Pick({.encodings = {kQuantized16, kPredicted}, .tolerance = 2e-5})
          .value();
  EXPECT_EQ(format.encoding, kPredicted);
}

TEST(PickFormat, TheCheapestIsWhatKeepsTheToleranceInFewestBytes) {
  const std::vector<const FrameEncoding*> all = {kFloat32, kPredicted,
                                                 kQuantized16};
  const auto cheapest = [&](double tolerance) {
    return Pick({.encodings = all, .cheapest = true, .tolerance = tolerance})
        ->encoding;
  };
  EXPECT_EQ(cheapest(0.01), kPredicted);
  EXPECT_EQ(cheapest(1e-9), kFloat32);
  EXPECT_EQ(Pick({.encodings = {kFloat32, kQuantized16},
                  .cheapest = true,
                  .tolerance = 0.01})
                ->encoding,
            kQuantized16);
}

TEST(PickFormat, ReceiversOfFloatsShareWhateverTheirTolerance) {
  EXPECT_EQ(Pick({.encodings = {kFloat32}, .tolerance = 0.01}).value(),
            Pick({}).value());
}

TEST(PickFormats, WhatNeedsWeightsComesWithOneThatNeedsNone) {
  const FrameEncoding* const pose = FindEncoding("pose");
  const auto pick = [](const FrameWishes& wishes) {
    return PickFormats(wishes, Rig(BallCage())).value();
  };
  const FrameFormats formats = pick({.encodings = {pose}});
  EXPECT_EQ(formats.format.encoding, pose);
  EXPECT_EQ(formats.otherwise.encoding, kFloat32);
  const FrameFormats cheapest =
      pick({.encodings = {kFloat32, pose, kPredicted, kQuantized16},
            .cheapest = true,
            .tolerance = 0.01});
  EXPECT_EQ(cheapest.format.encoding, pose);
  EXPECT_EQ(cheapest.otherwise.encoding, kPredicted);
  EXPECT_EQ(cheapest.otherwise.tolerance, 0.01);
  const FrameFormats none = pick({});
  EXPECT_EQ(none.otherwise, none.format);
}

// For the ball in its cage.
absl::StatusOr<Subscription> SubscribeTo(Delivery delivery,
                                         const FrameWishes& wishes) {
  return Subscribe(delivery, wishes, Rig(BallCage()),
                   MeshOf(Icosphere(0.5, 1)));
}

TEST(Subscribe, FramesASecondAreAnInterval) {
  const auto interval = [&](double max_fps) {
    return SubscribeTo(Delivery::kLatest, {.max_fps = max_fps})->interval;
  };
  EXPECT_EQ(interval(0), std::chrono::nanoseconds(0));
  EXPECT_EQ(interval(30), std::chrono::nanoseconds(33'333'333));
  EXPECT_EQ(interval(1000), std::chrono::milliseconds(1));
  EXPECT_EQ(interval(0.01), std::chrono::seconds(100));
  EXPECT_EQ(SubscribeTo(Delivery::kEvery, {})->delivery, Delivery::kEvery);
}

TEST(Subscribe, NormalsAreThereIfFacesAre) {
  EXPECT_FALSE(SubscribeTo(Delivery::kLatest, {})->normals);
  EXPECT_TRUE(SubscribeTo(Delivery::kEvery, {.normals = true})->normals);
  const auto refused = [](int dimension, const Shape& shape) {
    return Subscribe(
               Delivery::kLatest, {.normals = true}, Rig(BallCage()),
               Mesh::Create(dimension, shape.positions, shape.faces).value())
        .status();
  };
  const absl::Status points =
      refused(3, {.positions = Positions::Zero(3, 3), .faces = Faces(0, 3)});
  EXPECT_EQ(points.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(DetailOf(points).reason, "NO_NORMALS");
  EXPECT_EQ(points.message(),
            "the model has no faces, so its vertices have no normals: join "
            "without");
  Faces triangle(1, 3);
  triangle << 0, 1, 2;
  const absl::Status flat =
      refused(2, {.positions = Positions::Zero(3, 3), .faces = triangle});
  EXPECT_EQ(flat.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(flat.message(),
            "a model in two dimensions has no normals: join without");
}

struct BadRate {
  std::string name;
  Delivery delivery;
  double max_fps;
  std::string reason;
  std::string message;
};
class SubscribeRefuses : public testing::TestWithParam<BadRate> {};

TEST_P(SubscribeRefuses, BadRates) {
  const absl::Status status =
      SubscribeTo(GetParam().delivery, {.max_fps = GetParam().max_fps})
          .status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(DetailOf(status).reason, GetParam().reason);
  EXPECT_EQ(DetailOf(status).field, "max_fps");
  EXPECT_EQ(std::string(status.message()), GetParam().message);
}

INSTANTIATE_TEST_SUITE_P(
    Rates, SubscribeRefuses,
    testing::ValuesIn<BadRate>({
        {"Negative", Delivery::kLatest, -1, "MAX_FPS_OUT_OF_RANGE",
         "max_fps is -1, neither 0 nor within 0.01 and 1000"},
        {"TooMany", Delivery::kLatest, 1001, "MAX_FPS_OUT_OF_RANGE",
         "max_fps is 1001, neither 0 nor within 0.01 and 1000"},
        {"TooFew", Delivery::kLatest, 1e-300, "MAX_FPS_OUT_OF_RANGE",
         "max_fps is 1e-300, neither 0 nor within 0.01 and 1000"},
        {"NotANumber", Delivery::kLatest, NAN, "MAX_FPS_OUT_OF_RANGE",
         "max_fps is nan, neither 0 nor within 0.01 and 1000"},
        {"Infinite", Delivery::kLatest, INFINITY, "MAX_FPS_OUT_OF_RANGE",
         "max_fps is inf, neither 0 nor within 0.01 and 1000"},
        {"OfAll", Delivery::kEvery, 30, "CONTRADICTION",
         "max_fps leaves revisions out, but delivery EVERY sends all: set one "
         "of them"},
    }),
    [](const auto& test) { return test.param.name; });

struct BadWishes {
  std::string name;
  FrameWishes wishes;
  std::string reason;
  std::string message;
};
class PickFormatRefuses : public testing::TestWithParam<BadWishes> {};

TEST_P(PickFormatRefuses, BadWishes) {
  const absl::Status status = Pick(GetParam().wishes).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(DetailOf(status).reason, GetParam().reason);
  EXPECT_THAT(std::string(status.message()), HasSubstr(GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(
    Wishes, PickFormatRefuses,
    testing::ValuesIn<BadWishes>({
        {"BothTolerances",
         {.tolerance = 1, .tolerance_fraction = 1},
         "CONTRADICTION",
         "tolerance and tolerance_fraction are both set: state one of them"},
        {"NoTolerance",
         {.encodings = {kPredicted, kFloat32}},
         "TOLERANCE_MISSING",
         "encoding \"predicted\" needs a tolerance: set tolerance (model "
         "units) "
         "or tolerance_fraction (of the rig's diagonal)"},
        {"Zero",
         {.encodings = {kPredicted}, .tolerance = 0},
         "TOLERANCE_OUT_OF_RANGE",
         "tolerance is 0, not within 1e-30 and 1e28"},
        {"NotANumber",
         {.encodings = {kPredicted}, .tolerance_fraction = NAN},
         "TOLERANCE_OUT_OF_RANGE",
         "tolerance is nan"},
        {"Negative",
         {.encodings = {kFloat32}, .tolerance = -1},
         "TOLERANCE_OUT_OF_RANGE",
         "tolerance is -1"},
        {"TooFine",
         {.encodings = {kPredicted, kQuantized16}, .tolerance = 1e-7},
         "TOLERANCE_NOT_MET",
         "none of the encodings keeps a tolerance of 1e-07 for a rig of "
         "diagonal 3.4641: predicted keeps 9.53674e-07, quantized16 keeps "
         "2.66"},
    }),
    [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace deform::server
