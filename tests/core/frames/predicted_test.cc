#include "core/frames/encodings/predicted.h"

#include <gtest/gtest.h>

#include <hwy/targets.h>
#include <cmath>
#include <cstring>
#include <functional>
#include <memory>
#include <random>
#include <vector>

#include "absl/strings/escaping.h"
#include "core/base/error.h"
#include "tests/support/instruction_sets.h"

namespace deform {
namespace {

using Bytes = std::vector<uint8_t>;

// Chunks of a frame as large as they may be.
std::vector<Bytes> Encoded(const Grid& grid, const Grid* reference,
                           int dimension) {
  const int64_t per_chunk = PredictedEncoding().PointsPerChunk(dimension);
  std::vector<Bytes> chunks;
  for (int64_t first = 0; first == 0 || first < grid.size();
       first += per_chunk) {
    Bytes bytes(kMaxChunkBytes);
    const absl::StatusOr<int64_t> size = PredictedEncoding().Encode(
        {.dimension = dimension,
         .first = first,
         .count = std::min(per_chunk, grid.size() - first),
         .grid = &grid,
         .reference = reference},
        bytes.data());
    EXPECT_TRUE(size.ok());
    bytes.resize(size.value_or(0));
    chunks.push_back(std::move(bytes));
  }
  return chunks;
}

Grid Decoded(const std::vector<Bytes>& chunks, int64_t points,
             const Grid* reference, int dimension) {
  const int64_t per_chunk = PredictedEncoding().PointsPerChunk(dimension);
  Grid grid(points);
  for (size_t c = 0; c < chunks.size(); ++c) {
    const int64_t first = static_cast<int64_t>(c) * per_chunk;
    const absl::Status status = PredictedEncoding().Decode(
        chunks[c], {.dimension = dimension,
                    .first = first,
                    .count = std::min(per_chunk, points - first),
                    .grid = &grid,
                    .reference = reference});
    EXPECT_TRUE(status.ok()) << status;
  }
  return grid;
}

int64_t SizeOf(const std::vector<Bytes>& chunks) {
  int64_t size = 0;
  for (const Bytes& chunk : chunks) size += static_cast<int64_t>(chunk.size());
  return size;
}

// Where each point of a frame is, in steps, from 0 to 1 along the order.
using Place = std::function<double(double along, int d)>;

Grid GridOf(int64_t points, int dimension, const Place& place) {
  Grid grid(points);
  for (int d = 0; d < dimension; ++d) {
    for (int64_t i = 0; i < points; ++i) {
      grid.coordinate(d)[i] = static_cast<int32_t>(std::lrint(std::clamp(
          place(static_cast<double>(i) / static_cast<double>(points), d),
          -1.0 * kGridLimit, 1.0 * kGridLimit)));
    }
  }
  grid.Pad();
  return grid;
}

bool Same(const Grid& a, const Grid& b) {
  for (int d = 0; d < 3; ++d) {
    if (!std::equal(a.coordinate(d), a.coordinate(d) + a.padded_size(),
                    b.coordinate(d))) {
      return false;
    }
  }
  return a.size() == b.size();
}

constexpr const Grid* kNone = nullptr;

// Frames of any content: smooth, noisy, torn, as far apart as can be.
const Place kPlaces[] = {
    [](double, int) { return 0.0; },
    [](double u, int d) { return 3e4 * std::sin(9 * u + d) + 100 * u; },
    [](double u, int d) { return 3e4 * std::sin(9 * u + d + 0.01) + 250 * u; },
    [](double u, int d) { return 3e4 * std::sin(1e7 * u + d); },
    [](double u, int d) { return std::sin(1e5 * u + d) * 2 * kGridLimit; },
    [](double u, int) { return u < 0.5 ? -kGridLimit : kGridLimit; },
};

TEST(Predicted, GivesGridsBackFromEveryReference) {
  for (const int dimension : {2, 3}) {
    for (const int64_t points : {0, 1, 63, 64, 65, 255, 256, 257, 2000}) {
      for (const Place& from : kPlaces) {
        for (const Place& to : kPlaces) {
          const Grid reference = GridOf(points, dimension, from);
          const Grid grid = GridOf(points, dimension, to);
          for (const Grid* given : {&reference, kNone}) {
            const auto chunks = Encoded(grid, given, dimension);
            ASSERT_TRUE(Same(Decoded(chunks, points, given, dimension), grid));
          }
        }
      }
    }
  }
}

TEST(Predicted, IsTheSameOnEveryInstructionSet) {
  for (const Place& from : kPlaces) {
    for (const Place& to : kPlaces) {
      const Grid reference = GridOf(1000, 3, from);
      const Grid grid = GridOf(1000, 3, to);
      const auto chunks = Encoded(grid, &reference, 3);
      for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
        SCOPED_TRACE(hwy::TargetName(target));
        const OnInstructionSet on(target);
        EXPECT_EQ(Encoded(grid, &reference, 3), chunks);
        EXPECT_TRUE(Same(Decoded(chunks, 1000, &reference, 3), grid));
      }
    }
  }
}

TEST(Predicted, CutsLargeFramesIntoChunks) {
  const int64_t points = PredictedEncoding().PointsPerChunk(3) + 300;
  const Grid reference = GridOf(points, 3, kPlaces[1]);
  const Grid grid = GridOf(points, 3, kPlaces[2]);
  const auto chunks = Encoded(grid, &reference, 3);
  EXPECT_EQ(chunks.size(), 2u);
  EXPECT_TRUE(Same(Decoded(chunks, points, &reference, 3), grid));
}

TEST(Predicted, NeedsNextToNothingWhereBlocksMoveByALinearMap) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> uniform(-1000, 1000);
  Grid reference(2560), grid(2560);
  for (int64_t i = 0; i < 2560; ++i) {
    const double x[3] = {uniform(random), uniform(random), uniform(random)};
    for (int d = 0; d < 3; ++d) {
      reference.coordinate(d)[i] = static_cast<int32_t>(std::lrint(x[d]));
      grid.coordinate(d)[i] = static_cast<int32_t>(
          std::lrint(900 + 1.4 * x[d] - 0.7 * x[(d + 1) % 3]));
    }
  }
  // Residuals of two rounded grids: two or three bits, and 15 bytes a block.
  EXPECT_LT(SizeOf(Encoded(grid, &reference, 3)), 2560 * 3 * 3.5 / 8);
  // The positions themselves have 12.
  EXPECT_GT(SizeOf(Encoded(grid, nullptr, 3)), 2560 * 3 * 10 / 8);
  // And a frame that did not change has no residuals at all.
  EXPECT_LE(SizeOf(Encoded(grid, &grid, 3)), 10 * (1 + 3 * 5));
}

// The distance of point i between both, N x 3.
double Distance(const std::vector<float>& a, const std::vector<double>& b,
                int64_t i) {
  double squares = 0;
  for (int d = 0; d < 3; ++d) {
    squares += std::pow(a[3 * i + d] - b[3 * i + d], 2);
  }
  return std::sqrt(squares);
}

// A drag with jitter, and now and then a jump: each frame is predicted from the
// one before, as the receiver has decoded it.
TEST(Predicted, KeepsTenThousandFramesWithinTheTolerance) {
  constexpr int64_t kPoints = 300;
  constexpr double kTolerance = 1e-4;
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const Positions rest =
      Positions::NullaryExpr(kPoints, 3, [&] { return uniform(random); });
  const PointOrder order(rest);
  std::vector<double> meant(kPoints * 3);
  std::vector<float> decoded(kPoints * 3);
  std::unique_ptr<Grid> sent, received;
  for (int frame = 0; frame < 10000; ++frame) {
    const double angle = 0.02 * frame + 0.001 * uniform(random);
    const double jump = frame % 1000 == 999 ? 50 * uniform(random) : 0;
    for (int64_t i = 0; i < kPoints; ++i) {
      const double bend = angle * rest(i, 2);
      meant[3 * i] = rest(i, 0) + std::sin(bend) + jump;
      meant[3 * i + 1] = rest(i, 1) * std::cos(bend);
      meant[3 * i + 2] = rest(i, 2) + 0.001 * uniform(random);
    }
    auto grid = std::make_unique<Grid>(
        PutOnGrid(std::vector<float>(meant.begin(), meant.end()), 3, kTolerance,
                  order)
            .value());
    received = std::make_unique<Grid>(
        Decoded(Encoded(*grid, sent.get(), 3), kPoints, received.get(), 3));
    sent = std::move(grid);
    TakeOffGrid(*received, kTolerance, order, 3, decoded);
    for (int64_t i = 0; i < kPoints; ++i) {
      ASSERT_LE(Distance(decoded, meant, i), kTolerance) << "frame " << frame;
    }
  }
}

std::string Hex(const Bytes& bytes) {
  return absl::BytesToHexString(
      {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

Grid SmallGrid(std::initializer_list<int32_t> x,
               std::initializer_list<int32_t> y) {
  Grid grid(static_cast<int64_t>(x.size()));
  std::copy(x.begin(), x.end(), grid.coordinate(0));
  std::copy(y.begin(), y.end(), grid.coordinate(1));
  grid.Pad();
  return grid;
}

// A decoder written after the header alone must read these for ever.
TEST(Predicted, WritesAKeyframeAsTheseBytes) {
  const Grid grid = SmallGrid({5, 3, 6, 5}, {-300, -300, -300, -300});
  const auto chunks = Encoded(grid, nullptr, 2);
  ASSERT_EQ(chunks.size(), 1u);
  EXPECT_EQ(Hex(chunks[0]),
            "00"                // shift
            "04"                // x: offset of 1 byte
            "05"                //   5
            "02"                //   2 bits: 0, -2 -> 3, 1 -> 2, 0
            "0200000000000000"  //   the lower ones
            "0600000000000000"  //   the higher ones
            "08"                // y: offset of 2 bytes
            "d4fe"              //   -300
            "00");              //   no residuals
}

TEST(Predicted, ReadsEveryFieldAsTheHeaderSays) {
  // s = 3 (x >> 1) - 2 (y >> 1) + 2, then >> 2, in x; y stays.
  Bytes bytes;
  const std::string text = absl::HexStringToBytes(
      "01"                // shift
      "0d"                // x: gradients of 1 byte, offset of 4
      "02"                //   fraction
      "a0860100"          //   100000
      "03fe"              //   3, -2
      "01"                //   1 bit
      "0200000000000000"  //   of point 1: -1
      "02"                // y: gradients of 2 bytes, no offset
      "0000000000"        //   fraction, 0, 0
      "00");              //   no residuals
  bytes.assign(text.begin(), text.end());
  const Grid reference = SmallGrid({10, 21, 5}, {7, 8, -90});
  Grid grid(3);
  const absl::Status status = PredictedEncoding().Decode(
      bytes,
      {.dimension = 2, .count = 3, .grid = &grid, .reference = &reference});
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_EQ(grid.coordinate(0)[0], 10 + 100000);
  // 11 >> 1 = 5, 1 >> 1 = 0: (15 + 2) >> 2 = 4.
  EXPECT_EQ(grid.coordinate(0)[1], 21 + 100000 + 4 - 1);
  // -5 >> 1 = -3, -97 >> 1 = -49: (-9 + 98 + 2) >> 2 = 22.
  EXPECT_EQ(grid.coordinate(0)[2], 5 + 100000 + 22);
  EXPECT_EQ(grid.coordinate(1)[2], -90);
}

TEST(Predicted, SaysWhatIsWrongWithAChunk) {
  const auto message = [](absl::string_view hex, int64_t count = 3,
                          int64_t points = 3) {
    const std::string text = absl::HexStringToBytes(hex);
    Grid grid(points);
    const absl::Status status = PredictedEncoding().Decode(
        Bytes(text.begin(), text.end()),
        {.dimension = 2, .count = count, .grid = &grid});
    EXPECT_EQ(DetailOf(status).reason, "BAD_FRAME");
    return std::string(status.message());
  };
  EXPECT_EQ(message(""), "the chunk ends before its last block");
  EXPECT_EQ(message("20"), "a block has shift 32, of 31");
  EXPECT_EQ(message("00"), "a block ends before its prediction");
  EXPECT_EQ(message("0003"), "a prediction has the unknown sizes 3");
  EXPECT_EQ(message("0010"), "a prediction has the unknown sizes 16");
  EXPECT_EQ(message("000120"), "a prediction has no fraction from 0 to 31");
  EXPECT_EQ(message("000101"), "a block ends in its prediction");
  EXPECT_EQ(message("000405"), "a block ends before its residuals");
  EXPECT_EQ(message("000021"), "a group has 33 bits a residual, of 32");
  EXPECT_EQ(message("00000100"), "a block ends in its residuals");
  EXPECT_EQ(message("000000000007"), "a chunk has 1 bytes behind its blocks");
  EXPECT_EQ(message("0000000000", 3, 300),
            "a chunk holds points from 0 on, 3 of them: no whole blocks");
}

}  // namespace
}  // namespace deform
