#include "core/frames/vertex_fans.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <Eigen/Geometry>

#include "core/frames/normals.h"
#include "tests/support/shapes.h"

namespace deform {
namespace {

// What two bytes may take (normals.h).
constexpr double kByteError = 0.017;

std::vector<float> ToFloats(const Positions& positions) {
  std::vector<float> floats(positions.size());
  for (int64_t i = 0; i < positions.size(); ++i) {
    floats[i] = static_cast<float>(positions.data()[i]);
  }
  return floats;
}

std::vector<uint8_t> EncodedBy(const VertexFans& fans,
                               const std::vector<float>& positions,
                               ThreadPool* pool = nullptr) {
  std::vector<uint8_t> bytes(2 * fans.points());
  fans.EncodeNormals(positions, bytes, pool);
  return bytes;
}

// The largest angle between the plain normals and what the bytes say.
double LargestError(const std::vector<float>& positions, const Faces& faces) {
  const auto points = static_cast<int64_t>(positions.size() / 3);
  std::vector<float> plain(positions.size()), told(positions.size());
  ComputeNormals(positions, faces, plain);
  EXPECT_TRUE(
      DecodeNormals(EncodedBy(VertexFans(faces, points), positions), told)
          .ok());
  double largest = 0;
  for (size_t i = 0; i < plain.size(); i += 3) {
    const Vec3 a(plain[i], plain[i + 1], plain[i + 2]);
    const Vec3 b(told[i], told[i + 1], told[i + 2]);
    largest = std::max(largest, std::atan2(a.cross(b).norm(), a.dot(b)));
  }
  return largest;
}

TEST(VertexFans, SayWhatThePlainWaySays) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> shift(-0.02, 0.02);
  Shape ball = Icosphere(1, 5);  // 10,242 points: three blocks.
  for (const double scale : {1.0, 1e-30, 1e30}) {
    for (int64_t i = 0; i < ball.positions.size(); ++i) {
      ball.positions.data()[i] += shift(random);
    }
    EXPECT_LT(LargestError(ToFloats(ball.positions * scale), ball.faces),
              kByteError);
  }
}

TEST(VertexFans, OfAnyFacesSayWhatThePlainWaySays) {
  std::mt19937 random(4);
  for (int round = 0; round < 200; ++round) {
    const auto points = static_cast<int32_t>(1 + random() % 30);
    Faces faces(random() % 60, 3);
    for (int64_t i = 0; i < faces.size(); ++i) {
      faces.data()[i] = static_cast<int32_t>(random() % points);
    }
    // Whole numbers, few of them: many faces have no area, many sums are 0, and
    // all are exact.
    std::vector<float> positions(3 * points);
    for (float& x : positions) x = static_cast<float>(random() % 3);
    EXPECT_LT(LargestError(positions, faces), kByteError);
  }
}

TEST(VertexFans, GiveTheSameBytesOnAnyNumberOfThreads) {
  const Shape ball = Icosphere(1, 5);
  const std::vector<float> positions = ToFloats(ball.positions);
  const VertexFans fans(ball.faces, ball.positions.rows());
  const std::vector<uint8_t> bytes = EncodedBy(fans, positions);
  for (const int threads : {1, 3}) {
    ThreadPool pool({.threads = threads});
    EXPECT_EQ(EncodedBy(fans, positions, &pool), bytes);
  }
}

TEST(VertexFans, HaveAllVerticesOfEveryBlock) {
  for (const int64_t points : {1, 4095, 4096, 4097}) {
    Faces faces(1, 3);
    faces << 0, static_cast<int32_t>(points / 2),
        static_cast<int32_t>(points - 1);
    std::vector<float> positions(3 * points, 0.0F);
    positions[3 * (points / 2)] = 1;
    positions[3 * (points - 1) + 2] = 1;
    const std::vector<uint8_t> bytes =
        EncodedBy(VertexFans(faces, points), positions);
    // x cross z is -y.
    const uint8_t j = points == 1 ? 0 : 129;
    EXPECT_EQ(bytes[1], j);
    EXPECT_EQ(bytes[2 * (points / 2) + 1], j);
    EXPECT_EQ(bytes[2 * points - 1], j);
    if (points > 3) EXPECT_EQ(bytes[3], 0);
  }
}

TEST(VertexFans, WithoutFacesOrOfWhatIsNotFinitePointUp) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInf = std::numeric_limits<float>::infinity();
  EXPECT_EQ(EncodedBy(VertexFans(Faces(0, 3), 2), {0, 0, 0, 1, 1, 1}),
            std::vector<uint8_t>(4, 0));
  Faces faces(1, 3);
  faces << 0, 1, 2;
  for (const float bad : {kNan, kInf}) {
    EXPECT_EQ(
        EncodedBy(VertexFans(faces, 3), {bad, 0, 0, 1, bad, 0, 0, 0, bad}),
        std::vector<uint8_t>(6, 0));
  }
}

}  // namespace
}  // namespace deform
