#include "server/sessions/frame_maker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "core/frames/normals.h"
#include "core/weights/compress_binding.h"
#include "tests/server/sessions/support.h"

namespace deform::server {
namespace {

// Half a unit in the last place of float, for coordinates up to 1.
constexpr double kFloatUlp = 6e-8;
constexpr double kTolerance = 1e-4;

std::shared_ptr<const Binding> BindBall(int subdivisions) {
  return Bind({.model = std::make_shared<const Mesh>(
                   MeshOf(Icosphere(0.5, subdivisions))),
               .rig = BallCage(),
               .scheme = "green"},
              {})
      .value();
}

Pose PoseOf(const PoseUpdate& update) {
  Pose pose = RestPose(Rig(BallCage()));
  ApplyPoseUpdate(update, pose);
  return pose;
}

class FrameMakerTest : public testing::Test {
 protected:
  static FrameKey KeyOf(const char* encoding, double tolerance = 0) {
    return {
        .format = {.encoding = FindEncoding(encoding), .tolerance = tolerance}};
  }
  std::shared_ptr<const Frame> MakeOne(const FrameKey& key,
                                       const FrameInfo& info) {
    return maker_.Make(deformer_, info, {&key, 1}, nullptr).at(key);
  }
  double ErrorOf(const Positions& decoded) const {
    return (decoded - deformer_.positions()).rowwise().norm().maxCoeff();
  }

  FrameMaker maker_{std::make_shared<FrameTables>()};
  Deformer deformer_{BindBall(1), nullptr};
};

TEST_F(FrameMakerTest, WritesEveryVertexRelativeToTheOrigin) {
  const auto frame =
      MakeOne(KeyOf("float32"), {.revision = 7, .origin = {0.1, 0, -0.2}});
  EXPECT_EQ(frame->info.revision, 7u);
  EXPECT_EQ(frame->error_bound, 0);
  ASSERT_EQ(frame->chunks.size(), 1u);
  EXPECT_EQ(frame->chunks[0].vertex_count, kBallPoints);
  EXPECT_LT(ErrorOf(FrameDecoder().Decode(*frame)), 2 * kFloatUlp);
}

TEST_F(FrameMakerTest, CutsLargeModelsIntoChunksInOrder) {
  ThreadPool pool({.threads = 2});
  // 163,842 points: 1.9 MB.
  const Deformer deformer(BindBall(7), &pool);
  const FrameKey keys[] = {KeyOf("float32"), KeyOf("predicted", kTolerance)};
  for (const auto& [key, frame] : maker_.Make(deformer, {}, keys, &pool)) {
    ASSERT_GE(frame->chunks.size(), 2u);
    int64_t next = 0;
    for (const Frame::Chunk& chunk : frame->chunks) {
      EXPECT_EQ(chunk.first_vertex, next);
      EXPECT_LE(chunk.size, kMaxChunkBytes);
      next += chunk.vertex_count;
    }
    EXPECT_EQ(next, deformer.binding().point_count());
    EXPECT_LT((FrameDecoder().Decode(*frame) - deformer.positions())
                  .rowwise()
                  .norm()
                  .maxCoeff(),
              kTolerance);
  }
}

TEST_F(FrameMakerTest, EveryEncodingKeepsItsTolerance) {
  for (const FrameEncoding* encoding : AllEncodings()) {
    if (encoding->needs() != Needs::kNothing) continue;
    const auto frame = MakeOne(
        {.format = {.encoding = encoding, .tolerance = kTolerance}}, {});
    EXPECT_EQ(frame->encoding, encoding);
    EXPECT_FALSE(frame->reference_revision.has_value());
    EXPECT_LE(ErrorOf(FrameDecoder().Decode(*frame)), kTolerance)
        << encoding->id();
  }
}

TEST_F(FrameMakerTest, LeafCoefficientsAreOfTheBasisOrElseFloats) {
  const FrameKey key = KeyOf("basis", kTolerance);
  EXPECT_EQ(MakeOne(key, {})->encoding->id(), "float32");
  const auto dense = BindBall(2);
  const auto compressed =
      CompressBinding(*dense, &dense->weights(), 1e-5, {}).value();
  const Deformer deformer(compressed, nullptr);
  const auto basis = FrameTables().BasisOf(compressed);
  maker_.SetBasis(basis);
  const FrameInfo info{.revision = 1, .basis_id = basis->id};
  const auto frame = maker_.Make(deformer, info, {&key, 1}, nullptr).at(key);
  EXPECT_EQ(frame->encoding->id(), "basis");
  EXPECT_EQ(frame->held, nullptr);
  EXPECT_EQ(frame->error_bound, kTolerance);
  ASSERT_EQ(frame->chunks.size(), 1u);
  const Frame::Chunk& chunk = frame->chunks[0];
  std::vector<float> positions(3 * deformer.binding().point_count());
  ASSERT_TRUE(frame->encoding
                  ->Decode({chunk.bytes.get(), static_cast<size_t>(chunk.size)},
                           {.count = chunk.vertex_count,
                            .positions = positions,
                            .basis = basis->basis.get()})
                  .ok());
  const Eigen::Map<
      const Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>>
      decoded(positions.data(), chunk.vertex_count, 3);
  EXPECT_LE((decoded.cast<double>() - deformer.positions())
                .rowwise()
                .norm()
                .maxCoeff(),
            kTolerance + 1e-6);
}

TEST_F(FrameMakerTest, PredictsFromWhatTheReceiverHolds) {
  FrameKey key = KeyOf("predicted", kTolerance);
  const auto first = MakeOne(key, {.revision = 3});
  FrameDecoder receiver;
  receiver.Decode(*first);
  deformer_.MoveTo(PoseOf(MovedBy({0.1, 0.2, 0.3})));
  key.reference = first->held;
  const auto next = MakeOne(key, {.revision = 5});
  EXPECT_EQ(next->reference_revision, 3u);
  EXPECT_LE(ErrorOf(receiver.Decode(*next)), kTolerance);
  // All points have moved alike.
  EXPECT_LT(next->chunks[0].size * 4, first->chunks[0].size);
}

TEST_F(FrameMakerTest, FramesOfARevisionShareTheirGrid) {
  const FrameKey keyframe = KeyOf("predicted", kTolerance);
  const auto old = MakeOne(keyframe, {.revision = 1});
  const auto first = MakeOne(keyframe, {.revision = 2});
  FrameKey key = keyframe;
  key.reference = old->held;
  const auto other = MakeOne(key, {.revision = 2});
  EXPECT_EQ(other->held, first->held);
  EXPECT_NE(other->held, old->held);
  EXPECT_EQ(other->order, old->order);
}

TEST_F(FrameMakerTest, TakesFloatsWhereAToleranceCannotBeKept) {
  // 2^20 steps reach to 0.1; 65535 steps across the ball are 1.5e-5.
  const FrameKey keys[] = {KeyOf("predicted", 1e-7), KeyOf("quantized16", 1e-6),
                           KeyOf("float32")};
  const Frames frames = maker_.Make(deformer_, {}, keys, nullptr);
  for (const FrameKey& key : keys) {
    EXPECT_EQ(frames.at(key), frames.at(keys[2]));
    EXPECT_EQ(frames.at(key)->encoding->id(), "float32");
    EXPECT_EQ(frames.at(key)->held, nullptr);
  }
}

TEST_F(FrameMakerTest, LeavesTheWeightsTheirPartOfTheTolerance) {
  EXPECT_EQ(FrameMaker::ShareOf(1, 0), 1);
  EXPECT_EQ(FrameMaker::ShareOf(1, 0.25), 0.75);
  EXPECT_EQ(FrameMaker::ShareOf(1, 0.26), 0.5);
  const auto frame = MakeOne(KeyOf("predicted", kTolerance),
                             {.weight_error = 0.1 * kTolerance});
  EXPECT_EQ(frame->held->step, 0.75 * kTolerance);
  EXPECT_DOUBLE_EQ(frame->error_bound, 0.85 * kTolerance);
  // More than half: the encoding cannot make up for it, and the frame says so.
  EXPECT_DOUBLE_EQ(MakeOne(KeyOf("predicted", kTolerance),
                           {.revision = 1, .weight_error = kTolerance})
                       ->error_bound,
                   1.5 * kTolerance);
}

TEST_F(FrameMakerTest, NormalsAreThoseOfTheDeformedFaces) {
  const auto largest_error = [&](const FrameNormals& normals) {
    std::vector<float> told(3 * kBallPoints), plain(told.size()),
        positions(told.size());
    EXPECT_TRUE(DecodeNormals(normals, told).ok());
    deformer_.CopyRelative(0, kBallPoints, Vec3::Zero(), positions.data());
    ComputeNormals(positions, deformer_.binding().model()->faces(), plain);
    double largest = 0;
    for (size_t i = 0; i < told.size(); i += 3) {
      const Vec3 a(told[i], told[i + 1], told[i + 2]);
      const Vec3 b(plain[i], plain[i + 1], plain[i + 2]);
      largest = std::max(largest, std::atan2(a.cross(b).norm(), a.dot(b)));
    }
    return largest;
  };
  const auto rest = maker_.Normals(deformer_, {.revision = 1}, nullptr);
  EXPECT_LT(largest_error(*rest), 0.017);
  deformer_.MoveTo(PoseOf(MoveVertex(0, {-3, -1, -1})));
  // Once a revision, for all.
  EXPECT_EQ(maker_.Normals(deformer_, {.revision = 1}, nullptr), rest);
  ThreadPool pool({.threads = 2});
  const auto next =
      maker_.Normals(deformer_, {.revision = 2, .origin = {1, 2, 3}}, &pool);
  EXPECT_LT(largest_error(*next), 0.017);
  EXPECT_NE(*next, *rest);
}

TEST_F(FrameMakerTest, FramesAreTheSameWithAndWithoutNormals) {
  const FrameInfo info{.origin = {0.1, 0.2, 0.3}};
  for (const FrameEncoding* encoding : AllEncodings()) {
    const FrameKey key = {
        .format = {.encoding = encoding, .tolerance = kTolerance}};
    const auto chunk_of = [&](FrameMaker& maker) {
      const auto frame =
          maker.Make(deformer_, info, {&key, 1}, nullptr).at(key);
      const Frame::Chunk& chunk = frame->chunks.at(0);
      return std::vector<uint8_t>(chunk.bytes.get(),
                                  chunk.bytes.get() + chunk.size);
    };
    FrameMaker with(std::make_shared<FrameTables>());
    with.Normals(deformer_, info, nullptr);
    FrameMaker without(std::make_shared<FrameTables>());
    EXPECT_EQ(chunk_of(with), chunk_of(without)) << encoding->id();
  }
}

TEST(FrameTables, NameTheBasisOfCompressedWeights) {
  FrameTables tables;
  const auto dense = BindBall(1);
  EXPECT_EQ(tables.BasisOf(dense), nullptr);
  const auto compressed =
      CompressBinding(*dense, &dense->weights(), 1e-3, {}).value();
  const auto basis = tables.BasisOf(compressed);
  EXPECT_EQ(basis->basis->point_count(), kBallPoints);
  EXPECT_EQ(tables.BasisOf(compressed), basis);
  // The name is that of the bytes.
  const auto same =
      CompressBinding(*dense, &dense->weights(), 1e-3, {}).value();
  EXPECT_EQ(tables.BasisOf(same)->id, basis->id);
  const auto finer =
      CompressBinding(*dense, &dense->weights(), 1e-6, {}).value();
  EXPECT_NE(tables.BasisOf(finer)->id, basis->id);
}

TEST(FrameTables, AreKeptAsLongAsSomebodyHoldsThem) {
  FrameTables tables;
  const auto ball = std::make_shared<const Mesh>(MeshOf(Icosphere(0.5, 1)));
  const auto other = std::make_shared<const Mesh>(MeshOf(Icosphere(0.5, 2)));
  const auto order = tables.OrderOf(ball);
  EXPECT_EQ(order->size(), ball->size());
  EXPECT_EQ(tables.OrderOf(ball), order);
  EXPECT_EQ(tables.OrderOf(other)->size(), other->size());
  const auto fans = tables.FansOf(ball);
  EXPECT_EQ(fans->points(), ball->size());
  EXPECT_EQ(tables.FansOf(ball), fans);
  EXPECT_EQ(tables.FansOf(other)->points(), other->size());
}

}  // namespace
}  // namespace deform::server
