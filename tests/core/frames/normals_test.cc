#include "core/frames/normals.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include <Eigen/Geometry>

#include "core/base/error.h"
#include "tests/support/shapes.h"

namespace deform {
namespace {

std::vector<uint8_t> Encoded(const std::vector<float>& normals) {
  std::vector<uint8_t> bytes(normals.size() / 3 * 2);
  EncodeNormals(normals, bytes);
  return bytes;
}

std::vector<float> Decoded(const std::vector<uint8_t>& bytes) {
  std::vector<float> normals(bytes.size() / 2 * 3);
  EXPECT_TRUE(DecodeNormals(bytes, normals).ok());
  return normals;
}

// Angle between what is given and what comes back.
double Error(const Vec3& normal) {
  const Eigen::Vector3f given = normal.cast<float>();
  const std::vector<float> back =
      Decoded(Encoded({given[0], given[1], given[2]}));
  const Vec3 returned(back[0], back[1], back[2]);
  EXPECT_NEAR(returned.norm(), 1, 1e-6);
  return std::atan2(normal.cross(returned).norm(), normal.dot(returned));
}

TEST(Normals, ComeBackWithinADegree) {
  std::mt19937 random(1);
  std::normal_distribution<double> uniform;
  double largest = 0;
  for (int i = 0; i < 200000; ++i) {
    const Vec3 normal(uniform(random), uniform(random), uniform(random));
    largest = std::max(largest, Error(normal.normalized()));
  }
  EXPECT_LT(largest, 0.017);
  EXPECT_GT(largest, 0.012);  // The header does not say much more than it is.
}

TEST(Normals, ComeBackNextToThePolesTheEquatorAndTheFolds) {
  for (const double z : {-1.0, -1e-9, -0.0, 0.0, 1e-9, 1.0}) {
    for (const double x : {-1.0, -1e-9, -0.0, 0.0, 1e-9, 1.0}) {
      for (const double y : {-1.0, -1e-9, -0.0, 0.0, 1e-9, 1.0}) {
        const Vec3 normal(x, y, z);
        if (normal.norm() == 0) continue;
        EXPECT_LT(Error(normal.normalized()), 0.017);
      }
    }
  }
}

TEST(Normals, OfTheAxesAreExact) {
  for (int d = 0; d < 3; ++d) {
    for (const float sign : {-1.0F, 1.0F}) {
      for (const float zero : {-0.0F, 0.0F}) {
        std::vector<float> normal(3, zero);
        normal[d] = sign;
        EXPECT_EQ(Decoded(Encoded(normal)), normal);
      }
    }
  }
}

TEST(Normals, AreWrittenAsTheseBytes) {
  EXPECT_EQ(Encoded({0, 0, 1,   //
                     0, 0, -1,  //
                     1, 0, 0,   //
                     0, -1, 0,  //
                     -0.5F, 0.25F, -0.25F}),
            (std::vector<uint8_t>{0, 0,      //
                                  127, 127,  //
                                  127, 0,    //
                                  0, 129,    //
                                  161, 64}));
}

TEST(Normals, ThatAreNonePointUp) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInf = std::numeric_limits<float>::infinity();
  EXPECT_EQ(Encoded({0, 0, 0, kNan, 1, 0, 0, -kInf, 0}),
            (std::vector<uint8_t>{0, 0, 0, 0, 0, 0}));
}

TEST(Normals, OfAnyLengthGiveTheSameBytes) {
  for (const double length : {1e-323, 1e-300, 1.0, 1e300}) {
    uint8_t bytes[2] = {1, 1};
    EncodeNormal({0, -length, 0}, bytes);
    EXPECT_EQ(bytes[0], 0);
    EXPECT_EQ(bytes[1], 129);
  }
}

TEST(Normals, OfAnyBytesAreUnitVectors) {
  std::vector<uint8_t> bytes;
  for (int i = 0; i < 256; ++i) {
    for (int j = 0; j < 256; ++j) {
      bytes.push_back(static_cast<uint8_t>(i));
      bytes.push_back(static_cast<uint8_t>(j));
    }
  }
  const std::vector<float> normals = Decoded(bytes);
  for (size_t i = 0; i < normals.size(); i += 3) {
    ASSERT_NEAR(Vec3(normals[i], normals[i + 1], normals[i + 2]).norm(), 1,
                1e-6);
  }
}

TEST(Normals, NeedTwoBytesEach) {
  std::vector<float> normals(6);
  const absl::Status status = DecodeNormals(std::vector<uint8_t>(3), normals);
  EXPECT_EQ(DetailOf(status).reason, "BAD_FRAME");
  EXPECT_EQ(status.message(), "there are 3 bytes for 2 normals");
}

std::vector<float> NormalsOf(const Positions& positions, const Faces& faces) {
  std::vector<float> floats;
  for (int64_t i = 0; i < positions.rows(); ++i) {
    for (int d = 0; d < 3; ++d) {
      floats.push_back(static_cast<float>(positions(i, d)));
    }
  }
  std::vector<float> normals(floats.size());
  ComputeNormals(floats, faces, normals);
  return normals;
}

TEST(VertexNormals, OfABallPointOutwards) {
  const Shape ball = Icosphere(1, 4);
  // However small or large floats may be.
  for (const double scale : {1.0, 1e-38, 1e38}) {
    const std::vector<float> normals =
        NormalsOf(ball.positions * scale, ball.faces);
    for (int64_t i = 0; i < ball.positions.rows(); ++i) {
      const Vec3 normal(normals[3 * i], normals[3 * i + 1], normals[3 * i + 2]);
      // Of triangles of 1/16 of a radius.
      ASSERT_LT((normal - ball.positions.row(i).transpose()).norm(), 0.01);
    }
  }
}

TEST(VertexNormals, AreWeightedByArea) {
  // Around vertex 0: a triangle of area 3/2 in z = 0, one of 1/2 in x = 0.
  Positions positions(4, 3);
  positions << 0, 0, 0, 3, 0, 0, 0, 1, 0, 0, 0, 1;
  Faces faces(2, 3);
  faces << 0, 1, 2, 0, 2, 3;
  const std::vector<float> normals = NormalsOf(positions, faces);
  EXPECT_NEAR(normals[0], 1 / std::sqrt(10), 1e-6);
  EXPECT_NEAR(normals[1], 0, 1e-6);
  EXPECT_NEAR(normals[2], 3 / std::sqrt(10), 1e-6);
}

TEST(VertexNormals, OfNoAreaPointUp) {
  Positions positions(5, 3);
  positions << 0, 0, 0, 1, 0, 0, 2, 0, 0, 1, 0, 0, 7, 7, 7;
  Faces faces(2, 3);
  faces << 0, 1, 2, 1, 3, 3;  // On a line, and at a point; vertex 4 has none.
  const std::vector<float> normals = NormalsOf(positions, faces);
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(normals[3 * i], 0);
    EXPECT_EQ(normals[3 * i + 1], 0);
    EXPECT_EQ(normals[3 * i + 2], 1);
  }
}

}  // namespace
}  // namespace deform
