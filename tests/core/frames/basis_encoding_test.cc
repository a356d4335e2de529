#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "core/base/error.h"
#include "core/deform/deformer.h"
#include "core/frames/encoding.h"
#include "core/frames/encodings/one_chunk.h"
#include "core/frames/leaf_basis.h"
#include "tests/core/frames/leaf_bases.h"

namespace deform {
namespace {

using testing::HasSubstr;

constexpr double kTolerance = 1e-4;
// Roundings to float, in sums of numbers up to 2.
constexpr double kRounding = 3e-6;

class BasisEncodingTest : public testing::Test {
 protected:
  BasisEncodingTest() { sender_.MoveTo(Shaken(*binding_, 3, 0.2)); }

  std::vector<uint8_t> Encode() {
    std::vector<uint8_t> bytes(kMaxChunkBytes);
    bytes.resize(encoding_.Encode(source_, bytes.data()).value());
    return bytes;
  }
  absl::Status Decode(const std::vector<uint8_t>& bytes) {
    return encoding_.Decode(bytes, target_);
  }

  const FrameEncoding& encoding_ = *FindEncoding("basis");
  const std::shared_ptr<const Binding> binding_ =
      Bind(CompressedInBall(**FindScheme("green"), 3, 2000, 1e-5), {}).value();
  const std::shared_ptr<const LeafBasis> basis_ = LeafBasis::Of(binding_);
  const int64_t points_ = binding_->point_count();
  Deformer sender_{binding_, nullptr};
  std::vector<float> positions_ = std::vector<float>(points_ * 3);
  ChunkSource source_{.count = points_,
                      .tolerance = kTolerance,
                      .deformer = &sender_,
                      .basis = basis_.get()};
  ChunkTarget target_{.count = points_,
                      .positions = positions_,
                      .basis = basis_.get(),
                      .origin = {0.25, -0.5, 0}};
};

TEST_F(BasisEncodingTest, TheReceiverPlacesPointsWithinTheTolerance) {
  const std::vector<uint8_t> bytes = Encode();
  EXPECT_LT(bytes.size() * 4, positions_.size() * sizeof(float));
  ASSERT_TRUE(Decode(bytes).ok());
  const Positions expected = sender_.positions();
  double largest = 0;
  for (int64_t i = 0; i < points_; ++i) {
    const Eigen::Map<const Eigen::Vector3f> at(&positions_[3 * i]);
    const Vec3 place = at.cast<double>() + target_.origin;
    largest = std::max(largest, (place - Vec3(expected.row(i))).norm());
  }
  EXPECT_LE(largest, kTolerance + kRounding);
  EXPECT_GT(largest, 0.2 * kTolerance);
}

TEST_F(BasisEncodingTest, IsNotForDenseWeights) {
  source_.basis = nullptr;
  std::vector<uint8_t> bytes(kMaxChunkBytes);
  const absl::Status status = encoding_.Encode(source_, bytes.data()).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(DetailOf(status).reason, "NO_BASIS");
}

TEST(PutInOneChunk, TellsWhatIsTooLargeForOne) {
  std::vector<uint8_t> bytes(kMaxChunkBytes, 7), out(kMaxChunkBytes);
  EXPECT_EQ(PutInOneChunk("a pose", bytes, out.data()).value(), kMaxChunkBytes);
  EXPECT_EQ(out, bytes);
  bytes.push_back(7);
  const absl::Status status =
      PutInOneChunk("a pose", bytes, out.data()).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(DetailOf(status).reason, "FRAME_TOO_LARGE");
  EXPECT_EQ(status.message(),
            "a pose takes 1048577 bytes, a chunk at most 1048576");
}

TEST_F(BasisEncodingTest, IsRefusedWithoutTheBasis) {
  const std::vector<uint8_t> bytes = Encode();
  target_.basis = nullptr;
  const absl::Status status = Decode(bytes);
  EXPECT_EQ(DetailOf(status).reason, "BAD_FRAME");
  EXPECT_THAT(std::string(status.message()), HasSubstr("no basis is held"));
}

TEST_F(BasisEncodingTest, IsRefusedIfItIsCut) {
  const std::vector<uint8_t> bytes = Encode();
  target_.count = 1000;
  target_.positions = std::span<float>(positions_).first(3000);
  const absl::Status status = Decode(bytes);
  EXPECT_EQ(DetailOf(status).reason, "BAD_FRAME");
  EXPECT_THAT(std::string(status.message()),
              HasSubstr("cut: vertices from 0 on, 1000 of 2000"));
  target_.count = points_;
  target_.positions = positions_;
  const auto part = std::span<const uint8_t>(bytes).first(bytes.size() / 2);
  EXPECT_EQ(DetailOf(encoding_.Decode(part, target_)).reason, "BAD_FRAME");
}

}  // namespace
}  // namespace deform
