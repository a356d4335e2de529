#include "core/frames/pose_payload.h"

#include <gtest/gtest.h>

#include <cstring>
#include <limits>
#include <random>
#include <string>

#include "absl/strings/escaping.h"
#include "core/base/error.h"

namespace deform {
namespace {

Pose RandomPose(const PoseShape& shape, uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> uniform(-5, 5);
  Pose pose{.vertices = Positions::NullaryExpr(shape.rows + shape.fixed, 3,
                                               [&] { return uniform(random); }),
            .stretch_blend = 0.25};
  if (shape.dimension == 2) pose.vertices.col(2).setZero();
  return pose;
}

bool SameBits(const Pose& a, const Pose& b) {
  return std::memcmp(a.vertices.data(), b.vertices.data(),
                     a.vertices.size() * sizeof(double)) == 0 &&
         a.stretch_blend == b.stretch_blend;
}

TEST(PosePayload, BringsPosesBitByBit) {
  for (const int dimension : {2, 3}) {
    for (const int64_t rows : {1, 2, 100}) {
      const PoseShape shape{.dimension = dimension, .rows = rows, .fixed = 4};
      const Pose reference = RandomPose(shape, 1);
      for (const int64_t moved : {int64_t{0}, int64_t{1}, rows / 2, rows}) {
        Pose pose = reference;
        pose.stretch_blend = 0.75;
        for (int64_t i = 0; i < moved; ++i) pose.vertices(i, 0) = -0.0;
        const auto bytes = EncodePose(pose, &reference, shape);
        EXPECT_LE(bytes.size(), EncodePose(pose, nullptr, shape).size());
        const auto update = DecodePose(bytes, shape);
        ASSERT_TRUE(update.ok()) << update.status();
        Pose received = reference;
        ApplyPoseUpdate(*update, received);
        EXPECT_TRUE(SameBits(received, pose));
      }
    }
  }
}

TEST(PosePayload, NeedsNoReferenceIfAllRowsAreTold) {
  const PoseShape shape{.dimension = 3, .rows = 10, .fixed = 2};
  Pose pose = RandomPose(shape, 1);
  Pose received = RandomPose(shape, 2);
  received.vertices.bottomRows(2) = pose.vertices.bottomRows(2);
  ApplyPoseUpdate(DecodePose(EncodePose(pose, nullptr, shape), shape).value(),
                  received);
  EXPECT_TRUE(SameBits(received, pose));
}

std::string Hex(const std::vector<uint8_t>& bytes) {
  return absl::BytesToHexString(
      {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

// A decoder written after the header alone must read these for ever.
TEST(PosePayload, WritesTheseBytes) {
  const PoseShape shape{.dimension = 2, .rows = 3};
  Pose reference{.vertices = Positions::Zero(3, 3)};
  Pose pose = reference;
  pose.vertices.row(2) << 1, -2, 0;
  EXPECT_EQ(Hex(EncodePose(pose, &reference, shape)),
            "01"                                  // some rows
            "000000000000f03f"                    // blend 1
            "01000000"                            // one
            "02000000"                            // row 2
            "000000000000f03f00000000000000c0");  // 1, -2
  EXPECT_EQ(Hex(EncodePose(pose, nullptr, shape)),
            "00"
            "000000000000f03f"
            "00000000000000000000000000000000"
            "00000000000000000000000000000000"
            "000000000000f03f00000000000000c0");
}

TEST(PosePayload, SaysWhatIsWrongWithIt) {
  const PoseShape shape{.dimension = 2, .rows = 3, .fixed = 1};
  const auto message = [&](absl::string_view hex, absl::string_view reason) {
    const std::string text = absl::HexStringToBytes(hex);
    const absl::Status status =
        DecodePose({reinterpret_cast<const uint8_t*>(text.data()), text.size()},
                   shape)
            .status();
    EXPECT_EQ(DetailOf(status).reason, reason);
    return std::string(status.message());
  };
  const std::string blend = "000000000000f03f";
  const std::string place = "000000000000f03f00000000000000c0";
  EXPECT_EQ(message("", "BAD_FRAME"), "a pose begins with neither 0 nor 1");
  EXPECT_EQ(message("02" + blend, "BAD_FRAME"),
            "a pose begins with neither 0 nor 1");
  EXPECT_EQ(message("0000", "BAD_FRAME"),
            "a pose ends within its stretch blend");
  EXPECT_EQ(message("00" + blend + place, "BAD_FRAME"),
            "a pose has 16 bytes of coordinates, its 3 rows need 48");
  EXPECT_EQ(message("01" + blend + "000000", "BAD_FRAME"),
            "a pose ends before its rows");
  EXPECT_EQ(message("01" + blend + "ffffffff" + place, "BAD_FRAME"),
            "a pose ends within its 4294967295 rows");
  EXPECT_EQ(message("01" + blend + "0100000003000000" + place, "BAD_FRAME"),
            "row 0 of a pose is 3 of 3: not rising, or beyond the last");
  EXPECT_EQ(message("01" + blend + "020000000100000001000000" + place + place,
                    "BAD_FRAME"),
            "row 1 of a pose is 1 of 3: not rising, or beyond the last");
  EXPECT_EQ(message("01" + std::string("0000000000000040") + "00000000",
                    "STRETCH_BLEND_OUT_OF_RANGE"),
            "stretch blend must be in [0, 1], not 2");
  EXPECT_EQ(message("01" + blend + "0100000000000000" + "000000000000f07f" +
                        "0000000000000000",
                    "NON_FINITE"),
            "pose entry 0 has a coordinate that is not finite");
}

}  // namespace
}  // namespace deform
