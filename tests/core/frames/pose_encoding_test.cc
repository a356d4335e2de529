#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <vector>

#include "core/base/error.h"
#include "core/deform/deformer.h"
#include "core/frames/encoding.h"
#include "tests/support/shapes.h"

namespace deform {
namespace {

using testing::HasSubstr;

std::shared_ptr<const Binding> BallInCube() {
  return Bind({.model = std::make_shared<const Mesh>(MeshOf(Icosphere(0.5, 2))),
               .rig = CageOf(Cuboid(Vec3::Constant(-1), Vec3::Constant(1))),
               .scheme = "green"},
              {})
      .value();
}

Pose Moved(const Pose& pose, int vertex, const Vec3& by) {
  Pose moved = pose;
  moved.vertices.row(vertex) += by.transpose();
  return moved;
}

class PoseEncodingTest : public testing::Test {
 protected:
  std::vector<uint8_t> Encode(const Pose* reference = nullptr) {
    std::vector<uint8_t> bytes(kMaxChunkBytes);
    const ChunkSource source{
        .count = points_, .deformer = &sender_, .reference_pose = reference};
    bytes.resize(encoding_.Encode(source, bytes.data()).value());
    return bytes;
  }
  absl::Status Decode(const std::vector<uint8_t>& bytes,
                      const Pose* reference = nullptr) {
    return encoding_.Decode(bytes, {.count = points_,
                                    .positions = positions_,
                                    .deformer = &receiver_,
                                    .reference_pose = reference,
                                    .origin = origin_,
                                    .error_bound = &error_bound_});
  }
  std::vector<float> Expected() const {
    std::vector<float> expected(positions_.size());
    sender_.CopyRelative(0, points_, origin_, expected.data());
    return expected;
  }

  const FrameEncoding& encoding_ = *FindEncoding("pose");
  const std::shared_ptr<const Binding> binding_ = BallInCube();
  const int64_t points_ = binding_->point_count();
  const Vec3 origin_{0.25, -0.5, 0};
  Deformer sender_{binding_, nullptr};
  Deformer receiver_{binding_, nullptr};
  std::vector<float> positions_ = std::vector<float>(points_ * 3);
  double error_bound_ = -1;
};

TEST_F(PoseEncodingTest, TheReceiverDeformsAsTheSenderDid) {
  sender_.MoveTo(Moved(sender_.pose(), 3, {0.1, 0.2, -0.3}));
  ASSERT_TRUE(Decode(Encode()).ok());
  EXPECT_EQ(receiver_.pose().vertices, sender_.pose().vertices);
  EXPECT_EQ(positions_, Expected());
  EXPECT_EQ(error_bound_, 0);
}

TEST_F(PoseEncodingTest, TellsOnlyWhatHasMovedSinceTheReference) {
  Pose reference = sender_.pose();
  for (int i = 0; i < 8; ++i) {
    sender_.MoveTo(Moved(reference, i, {0.01, 0, 0.02}));
    const std::vector<uint8_t> bytes = Encode(&reference);
    EXPECT_LE(bytes.size(), 41u);
    ASSERT_TRUE(Decode(bytes, &reference).ok());
    EXPECT_EQ(receiver_.pose().vertices, sender_.pose().vertices);
    reference = sender_.pose();
  }
}

TEST_F(PoseEncodingTest, AKeyframeMakesGoodWhateverTheReceiverHad) {
  receiver_.MoveTo(Moved(receiver_.pose(), 5, {0, 0, 1}));
  sender_.MoveTo(Moved(sender_.pose(), 1, {0, 0, 1}));
  ASSERT_TRUE(Decode(Encode()).ok());
  EXPECT_EQ(receiver_.pose().vertices, sender_.pose().vertices);
}

TEST_F(PoseEncodingTest, IsRefusedWithoutWeights) {
  const absl::Status status =
      encoding_.Decode(Encode(), {.count = points_, .positions = positions_});
  EXPECT_EQ(DetailOf(status).reason, "BAD_FRAME");
  EXPECT_THAT(std::string(status.message()), HasSubstr("no weights are held"));
}

TEST_F(PoseEncodingTest, RefusesAKeyframeThatTellsSomeRows) {
  const Pose reference = sender_.pose();
  sender_.MoveTo(Moved(reference, 2, {0, 0, 1}));
  const absl::Status status = Decode(Encode(&reference));
  EXPECT_EQ(DetailOf(status).reason, "BAD_FRAME");
  EXPECT_THAT(std::string(status.message()),
              HasSubstr("a keyframe tells 1 of the 8 rows"));
}

TEST_F(PoseEncodingTest, RefusesWhatIsNoPose) {
  std::vector<uint8_t> bytes = Encode();
  const double not_a_number = std::numeric_limits<double>::quiet_NaN();
  std::memcpy(bytes.data() + 9, &not_a_number, sizeof(double));
  EXPECT_EQ(DetailOf(Decode(bytes)).reason, "BAD_FRAME");
  for (size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_EQ(DetailOf(Decode({bytes.begin(), bytes.begin() + size})).reason,
              "BAD_FRAME");
  }
  EXPECT_EQ(receiver_.pose().vertices, RestVertices(binding_->rig()));
}

}  // namespace
}  // namespace deform
