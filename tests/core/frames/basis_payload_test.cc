#include "core/frames/basis_payload.h"

#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "absl/strings/escaping.h"
#include "core/base/error.h"
#include "tests/core/frames/leaf_bases.h"

namespace deform {
namespace {

LeafPose TinyPose() {
  LeafPose pose{.coefficients = {1, -0.5, 0, 0.0625, 0, 0, -3, 0.125, 0}};
  pose.map.linear.topLeftCorner<2, 2>() << 0, -1, 1, 0;
  pose.map.from << 0.5, 0.5, 0;
  pose.map.to << 2, 0, 0;
  return pose;
}

std::string Hex(const std::vector<uint8_t>& bytes) {
  return absl::BytesToHexString(
      {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

std::vector<uint8_t> Bytes(absl::string_view hex) {
  const std::string text = absl::HexStringToBytes(hex);
  return {text.begin(), text.end()};
}

const char kTinyMap[] =
    "0000000000000000000000000000f0bf"   // 0, -1
    "000000000000f03f0000000000000000"   // 1, 0
    "000000000000e03f000000000000e03f"   // from 1/2, 1/2
    "00000000000000400000000000000000";  // to 2, 0
const char kTinyFloats[] =
    "0000000000000000"   // unit 0
    "0000803f000000bf"   // 1, -1/2
    "0000803d00000000"   // 1/16, 0
    "000040c00000003e";  // -3, 1/8

// A decoder written after the header alone must read these for ever.
TEST(BasisPayload, IsTheseBytes) {
  const auto basis = LeafBasis::Of(TinyBinding());
  EXPECT_EQ(Hex(EncodeLeafPose(TinyPose(), *basis, 0, nullptr).value()),
            std::string(kTinyMap) + kTinyFloats);
  EXPECT_EQ(Hex(EncodeLeafPose(TinyPose(), *basis, 0.5, nullptr).value()),
            std::string(kTinyMap) +
                "000000000000e03e"      // unit 2^-17
                "00008040b40115c42f");  // bits
  // They say 1.03125, -0.46875; 0.0615234375, 0; -3, 0.09375.
  const LeafPose pose =
      DecodeLeafPose(EncodeLeafPose(TinyPose(), *basis, 0.5, nullptr).value(),
                     *basis)
          .value();
  EXPECT_EQ(pose.coefficients,
            (std::vector<float>{1.03125, -0.46875, 0, 0.0615234375, 0, 0, -3,
                                0.09375, 0}));
  EXPECT_EQ(pose.map.linear, TinyPose().map.linear);
}

// -1/2 and 1/4 are what its first point is turned to, -18.75 and -21 what the
// columns add.
TEST(BasisPayload, MovesPointsByTheSumsOfTheirLeaf) {
  const auto basis = LeafBasis::Of(TinyBinding());
  std::vector<float> positions(6);
  ASSERT_TRUE(
      PlacePoints(TinyPose(), *basis, Vec3(1, 0, 0), nullptr, positions).ok());
  EXPECT_EQ(positions,
            (std::vector<float>{2 + 1 + 12.5 + 9 - 1, -0.25 - 0.5 - 0.375,  //
                                0.5 - 1, 0.5,                               //
                                2 + 1 - 18.75 - 21 - 1, -0.25 - 0.5 + 0.875}));
}

TEST(BasisPayload, IsToldAsItIsWhereItCannotBeRounded) {
  const auto basis = LeafBasis::Of(TinyBinding());
  for (const double tolerance : {1e-12, 1e-310}) {
    EXPECT_EQ(
        Hex(EncodeLeafPose(TinyPose(), *basis, tolerance, nullptr).value()),
        std::string(kTinyMap) + kTinyFloats);
  }
}

TEST(BasisPayload, IsNotToldIfItIsNotFinite) {
  const auto basis = LeafBasis::Of(TinyBinding());
  const auto expect_refused = [&](const LeafPose& pose) {
    for (const double tolerance : {0.0, 1e-3}) {
      const absl::Status status =
          EncodeLeafPose(pose, *basis, tolerance, nullptr).status();
      EXPECT_EQ(DetailOf(status).reason, "NON_FINITE");
      EXPECT_EQ(status.message(),
                "a pose has coefficients that are not finite, or beyond 1e+30");
    }
  };
  LeafPose pose = TinyPose();
  pose.coefficients[4] = std::numeric_limits<float>::quiet_NaN();
  expect_refused(pose);
  pose.coefficients[4] = 2e30F;
  expect_refused(pose);
  pose = TinyPose();
  pose.map.to(1) = -std::numeric_limits<double>::infinity();
  expect_refused(pose);
}

TEST(BasisPayload, SaysWhatIsWrongWithItsBytes) {
  const auto basis = LeafBasis::Of(TinyBinding());
  const auto message = [&](absl::string_view hex) {
    const absl::Status status = DecodeLeafPose(Bytes(hex), *basis).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_EQ(DetailOf(status).reason, "BAD_FRAME");
    return std::string(status.message());
  };
  const std::string map = kTinyMap, floats = kTinyFloats;
  const std::string infinity = "000000000000f07f", one = "000000000000f03f";
  EXPECT_EQ(message(map), "the frame has 64 bytes, its basis needs 72 to 96");
  EXPECT_EQ(message(map + floats + "00"),
            "the frame has 97 bytes, its basis needs 72 to 96");
  EXPECT_EQ(message(infinity + map.substr(16) + floats),
            "the frame's map is not finite");
  EXPECT_EQ(message(map + infinity),
            "the frame's unit is inf, not 0 or "
            "positive");
  EXPECT_EQ(message(map + "000000000000f0bf"),
            "the frame's unit is -1, not 0 or positive");
  EXPECT_EQ(message(map + floats.substr(0, floats.size() - 2)),
            "the frame has 95 bytes, its floats need 96");
  EXPECT_EQ(
      message(map + floats.substr(0, 16) + "0000c07f" + floats.substr(24)),
      "the frame has a coefficient that is not finite");
  const std::string ends =
      "the frame's bits end, or go beyond 32 a number, in leaf 0";
  EXPECT_EQ(message(map + one), ends);
  EXPECT_EQ(message(map + one + "01"), ends);
  // A step: f = 1 (-1): 1, 1 0.
  EXPECT_EQ(message(map + one + "03"),
            "leaf 0 tells a step of -1, not 0 to 127");
  // f = 256 (128): 64 zeros, 1, 0 0.
  EXPECT_EQ(message(map + one + "000000000000000001"),
            "leaf 0 tells a step of 128, not 0 to 127");
  // Step 0: 1, 0 0; then f = 1 (-1) with 1: 1, 1.
  EXPECT_EQ(message(map + one + "19"),
            "leaf 0 tells a parameter of -1, not 0 to 31");
  // f = 64 (32) with 1: 32 zeros, 1, 0.
  EXPECT_EQ(message(map + one + "0100000008"),
            "leaf 0 tells a parameter of 32, not 0 to 31");
  // All 0: step 1 0 0, parameters 1 0 and 1, filled up; and more.
  EXPECT_TRUE(DecodeLeafPose(Bytes(map + one + "29"), *basis).ok());
  EXPECT_EQ(message(map + one + "a9"),
            "the frame goes on behind its last leaf");
  EXPECT_EQ(message(map + one + "2900"),
            "the frame goes on behind its last leaf");
  // Steps of 4 of the largest doubles: step 1 0 0; parameters 0 1 0, 0 1.
  EXPECT_EQ(message(map + "ffffffffffffef7f" + "d10b"),
            "the frame has a coefficient that is not finite");
}

TEST(BasisPayload, PutsPointsNowhereThatIsNotFinite) {
  const auto basis = LeafBasis::Of(TinyBinding());
  std::vector<float> positions(6);
  const auto expect_refused = [&](const LeafPose& pose) {
    const absl::Status status =
        PlacePoints(pose, *basis, Vec3::Zero(), nullptr, positions);
    EXPECT_EQ(DetailOf(status).reason, "BAD_FRAME");
    EXPECT_EQ(status.message(), "the frame puts points at no finite place");
  };
  LeafPose pose = TinyPose();
  pose.coefficients[3] = 3e38F;
  expect_refused(pose);
  pose = TinyPose();
  pose.map.to(1) = 1e40;
  expect_refused(pose);
}

}  // namespace
}  // namespace deform
