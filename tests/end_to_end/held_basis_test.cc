// Clients that hold the leaf basis of compressed weights, and get coefficients.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/base/error.h"
#include "core/frames/leaf_basis.h"
#include "deform/v1/binding.pb.h"
#include "tests/end_to_end/raw_call.h"
#include "tests/end_to_end/running_server.h"

namespace deform {
namespace {

using testing::HasSubstr;

constexpr int64_t kPoints = 20'000;
constexpr double kWeightTolerance = 1e-5;
constexpr double kFrameTolerance = 1e-4;

// 42 vertices and 80 faces: dense weights take 9.8 MB.
Cage Rig() { return CageOf(Icosphere(1, 1)); }

Mesh Cloud() {
  std::srand(1);
  Positions points = Positions::Random(kPoints, 3) * 0.45;
  return Mesh::Create(3, std::move(points), {}).value();
}

class HeldBasisTest : public testing::Test {
 protected:
  HeldBasisTest() : binding_(BindTo(kWeightTolerance)) {
    session_ = client().CreateSession(binding_.binding_id)->session_id;
  }

  Client& client() { return server_.client(); }
  BindingInfo BindTo(double tolerance) {
    const ModelInfo model = client().RegisterModel(Cloud(), "cloud").value();
    return client()
        .CreateBinding({.model_id = model.model_id,
                        .rig = Rig(),
                        .weight_tolerance = tolerance})
        .value();
  }
  // Waits for it.
  HeldBasis Download(const HeldBasis& known = {}) {
    return client().DownloadBasis(binding_.binding_id, {}, known).value();
  }
  DeformOptions Wanting(const HeldBasis& basis) {
    return {.delivery = Delivery::kEvery,
            .tolerance_fraction = kFrameTolerance,
            .encodings = {"basis", "predicted"},
            .basis = basis};
  }
  // The next frames of both are the same, within the tolerance.
  void ExpectSame(DeformStream& holder, DeformStream& plain,
                  const std::string& encoding) {
    Frame judge;
    ASSERT_TRUE(holder.NextFrame(frame_).ok());
    ASSERT_TRUE(plain.NextFrame(judge).ok());
    EXPECT_EQ(frame_.encoding, encoding);
    EXPECT_EQ(frame_.revision, judge.revision);
    EXPECT_LT((frame_.DoublePositions() - judge.DoublePositions())
                  .rowwise()
                  .norm()
                  .maxCoeff(),
              (kFrameTolerance + 2e-6) * binding_.rig_diagonal);
  }
  static PoseUpdate Drag(int i) {
    PoseUpdate update{.vertices = {7}, .positions = Positions::Ones(1, 3)};
    update.positions(0, 0) += 0.5 * std::sin(0.1 * i);
    return update;
  }

  RunningServer server_;
  const BindingInfo binding_;
  std::string session_;
  Frame frame_;
};

TEST_F(HeldBasisTest, LeafCoefficientsComeInsteadOfVertices) {
  const HeldBasis basis = Download();
  EXPECT_EQ(basis.basis->point_count(), kPoints);
  auto plain = client().Deform(session_, Delivery::kEvery).value();
  auto holder = client().Deform(session_, Wanting(basis)).value();
  EXPECT_EQ(holder.joined().encoding, "basis");
  ExpectSame(holder, plain, "basis");
  for (int i = 1; i < 50; ++i) {
    plain.Send(Drag(i)).value();
    ExpectSame(holder, plain, "basis");
    EXPECT_EQ(frame_.basis_id, basis.basis_id);
    EXPECT_LT(frame_.bytes * 20, kPoints * 12);
    EXPECT_LE(frame_.error_bound,
              (kFrameTolerance + kWeightTolerance) * binding_.rig_diagonal);
  }
  plain.Send({.positions = 2 * Rig().vertices(), .stretch_blend = 0.5}).value();
  ExpectSame(holder, plain, "basis");
}

TEST_F(HeldBasisTest, ItMayComeLaterWhenFramesTellOfIt) {
  auto plain = client().Deform(session_, Delivery::kEvery).value();
  auto holder = client().Deform(session_, Wanting({})).value();
  ExpectSame(holder, plain, "predicted");
  const HeldBasis basis = Download();
  // Sessions change over between two poses, soon after.
  int i = 0;
  while (frame_.basis_id != basis.basis_id) {
    plain.Send(Drag(++i)).value();
    ExpectSame(holder, plain, "predicted");
  }
  ASSERT_TRUE(holder.Hold(basis).ok());
  // What is sent behind it finds it there.
  holder.Send(Drag(++i)).value();
  ExpectSame(holder, plain, "basis");
}

TEST_F(HeldBasisTest, WhatIsKnownIsNotSentAgain) {
  const HeldBasis basis = Download();
  EXPECT_EQ(Download(basis).basis, basis.basis);
  EXPECT_NE(Download({"other", basis.basis}).basis, basis.basis);
}

TEST_F(HeldBasisTest, AnotherBasisDoesNotServe) {
  const HeldBasis basis = Download();
  auto plain = client().Deform(session_, Delivery::kEvery).value();
  auto holder = client().Deform(session_, Wanting({"00", basis.basis})).value();
  ExpectSame(holder, plain, "predicted");
  plain.Send(Drag(1)).value();
  ExpectSame(holder, plain, "predicted");
}

TEST_F(HeldBasisTest, DenseWeightsHaveNone) {
  const BindingInfo dense = BindTo(0);
  const auto refused = client().DownloadBasis(dense.binding_id);
  EXPECT_EQ(refused.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(DetailOf(refused.status()).reason, "NO_BASIS");
  EXPECT_THAT(std::string(refused.status().message()),
              HasSubstr("has no leaf basis: its weights are dense; bind with "
                        "a weight_tolerance"));
  // Small ones stay dense.
  const ModelInfo model = client().RegisterModel(Ball(), "ball").value();
  const BindingInfo small = client()
                                .CreateBinding({.model_id = model.model_id,
                                                .rig = Cube(),
                                                .weight_tolerance = 1e-4})
                                .value();
  const auto why = client().DownloadBasis(small.binding_id);
  EXPECT_EQ(DetailOf(why.status()).reason, "NO_BASIS");
  EXPECT_THAT(std::string(why.status().message()),
              HasSubstr("its weights are dense (they are small: "));
  EXPECT_EQ(client().DownloadBasis("nowhere").status().code(),
            absl::StatusCode::kNotFound);
}

// Who does not wait is told to come again, until it is there.
TEST_F(HeldBasisTest, WhileWeightsAreCompressedThereIsNoneYet) {
  v1::DownloadBasisRequest request;
  request.set_binding_id(binding_.binding_id);
  for (;;) {
    const RawAnswer answer =
        RawCall(server_.address(), "/deform.v1.BindingService/DownloadBasis",
                request.SerializeAsString());
    if (answer.status.ok()) break;
    EXPECT_EQ(answer.status.code(), absl::StatusCode::kFailedPrecondition);
    EXPECT_EQ(DetailOf(answer.status).reason, "NO_BASIS");
    EXPECT_THAT(std::string(answer.status.message()),
                HasSubstr("its weights are being compressed, try again"));
  }
}

TEST_F(HeldBasisTest, ABasisOfAnotherModelIsRefused) {
  const HeldBasis basis = Download();
  const std::string ball = server_.BallSession();
  const auto refused = client().Deform(ball, Wanting(basis));
  EXPECT_EQ(DetailOf(refused.status()).reason, "OTHER_MODEL");
  EXPECT_THAT(std::string(refused.status().message()),
              HasSubstr("this basis is of a model with 20000 points in 3D, the "
                        "session's has 162 in 3D"));
}

TEST_F(HeldBasisTest, GivingUpTheDownload) {
  const auto answer = client().DownloadBasis(
      binding_.binding_id, [](int64_t, int64_t) { return false; });
  EXPECT_EQ(answer.status().code(), absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace deform
