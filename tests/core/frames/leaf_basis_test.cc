#include "core/frames/leaf_basis.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "absl/strings/escaping.h"
#include "core/base/error.h"
#include "tests/core/frames/leaf_bases.h"

namespace deform {
namespace {

constexpr int64_t kPlenty = 1 << 30;

std::shared_ptr<const LeafBasis> Received(const std::vector<uint8_t>& bytes) {
  auto basis = LeafBasis::FromBytes(bytes, kPlenty);
  EXPECT_TRUE(basis.ok()) << basis.status();
  return *basis;
}

void ExpectSame(const LeafBasis& a, const LeafBasis& b) {
  EXPECT_EQ(a.dimension(), b.dimension());
  EXPECT_EQ(Positions(a.rest()), Positions(b.rest()));
  EXPECT_TRUE(std::ranges::equal(a.slots(), b.slots()));
  EXPECT_EQ(a.slot_count(), b.slot_count());
  EXPECT_EQ(a.coefficient_rows(), b.coefficient_rows());
  ASSERT_EQ(a.leaves().size(), b.leaves().size());
  for (size_t l = 0; l < a.leaves().size(); ++l) {
    const LeafBasis::Leaf &left = a.leaves()[l], &right = b.leaves()[l];
    EXPECT_EQ(left.first_slot, right.first_slot);
    EXPECT_EQ(left.blocks, right.blocks);
    EXPECT_EQ(left.columns.floats, right.columns.floats);
    EXPECT_EQ(left.columns.shorts, right.columns.shorts);
    EXPECT_EQ(left.columns.bytes, right.columns.bytes);
    EXPECT_EQ(left.first_row, right.first_row);
    EXPECT_EQ(
        0, std::memcmp(left.exponents, right.exponents, left.columns.count()));
    EXPECT_EQ(0, std::memcmp(left.numbers, right.numbers,
                             left.blocks * left.columns.block_bytes()));
  }
}

TEST(LeafBasis, ComesBackAsItWas) {
  for (const int dimension : {2, 3}) {
    for (const double tolerance : {1e-3, 1e-6}) {
      const auto basis =
          LeafBasis::Of(Bind(CompressedInBall(**FindScheme("green"), dimension,
                                              3000, tolerance),
                             {})
                            .value());
      const std::vector<uint8_t> bytes = basis->ToBytes();
      EXPECT_EQ(std::ssize(bytes), basis->byte_count());
      const auto received = Received(bytes);
      ExpectSame(*basis, *received);
      EXPECT_EQ(received->ToBytes(), bytes);
    }
  }
}

TEST(LeafBasis, HasTheNumbersAndPlacesOfItsBinding) {
  const std::shared_ptr<const Binding> binding =
      Bind(CompressedInBall(**FindScheme("green"), 3, 2000, 1e-5), {}).value();
  const auto basis = Received(LeafBasis::Of(binding)->ToBytes());
  const CompressedWeights& weights = *binding->compressed();
  EXPECT_EQ(Positions(basis->rest()), binding->model()->positions());
  size_t index = 0;
  for (const auto& branch : weights.parts().branches) {
    for (const auto& leaf : branch.leaves) {
      const LeafBasis::Leaf& received = basis->leaves()[index++];
      EXPECT_EQ(received.first_slot, leaf.first_slot);
      for (int64_t k = 0; k < leaf.columns.count(); ++k) {
        double squares = 0;
        for (int64_t i = 0; i < leaf.blocks * kBlockPoints; ++i) {
          const double number = MixedNumber(
              received.numbers + i / kBlockPoints * leaf.columns.block_bytes(),
              leaf.columns, k, i % kBlockPoints);
          // Those of integer columns are told without the leaf's step.
          EXPECT_EQ(
              number * (k < leaf.columns.floats ? 1 : leaf.step),
              LeafNumber(leaf, branch.numbers.data(), k, leaf.first_slot + i));
          squares += number * number;
        }
        // 2^e is within a factor of sqrt(2) of the root of the mean square.
        const double mean = squares / static_cast<double>(leaf.blocks * 64);
        const double power = std::ldexp(1, 2 * received.exponents[k]);
        EXPECT_GE(mean, power / 2);
        EXPECT_LT(mean, power * 2);
      }
    }
  }
  EXPECT_EQ(index, basis->leaves().size());
  EXPECT_EQ(basis->slots()[3], -1);
  EXPECT_EQ(std::ranges::count(basis->slots(), -1), 2);
}

TEST(LeafBasis, IsTheSameBytesForTheSameWeights) {
  ThreadPool pool({.threads = 3});
  const BindRequest request =
      CompressedInBall(**FindScheme("s_cc"), 3, 3000, 1e-5);
  EXPECT_EQ(LeafBasis::Of(Bind(request, {}).value())->ToBytes(),
            LeafBasis::Of(Bind(request, {.pool = &pool}).value())->ToBytes());
}

TEST(LeafBasis, IsSentInPiecesWithoutACopy) {
  const std::shared_ptr<const Binding> binding =
      Bind(CompressedInBall(**FindScheme("green"), 3, 5000, 1e-4), {}).value();
  const auto basis = LeafBasis::Of(binding);
  std::vector<uint8_t> all;
  bool of_model = false;
  for (const auto piece : basis->Pieces(10000)) {
    EXPECT_LE(piece.size(), 10000u);
    of_model = of_model || static_cast<const void*>(piece.data()) ==
                               binding->model()->positions().data();
    const auto* from = reinterpret_cast<const uint8_t*>(piece.data());
    all.insert(all.end(), from, from + piece.size());
  }
  EXPECT_TRUE(of_model);
  EXPECT_EQ(all, basis->ToBytes());
}

TEST(LeafBasis, MayMoveNobody) {
  BindRequest request = CompressedInBall(**FindScheme("green"), 3, 40, 1e-4);
  request.clamped.clear();
  for (int64_t i = 0; i < 40; ++i) request.clamped.push_back(i);
  const auto basis =
      Received(LeafBasis::Of(Bind(request, {}).value())->ToBytes());
  EXPECT_TRUE(basis->leaves().empty());
  EXPECT_EQ(basis->coefficient_rows(), 0);
}

std::string Hex(std::span<const uint8_t> bytes) {
  return absl::BytesToHexString(
      {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}
std::string Zeros(size_t bytes) { return std::string(2 * bytes, '0'); }

// A decoder written after the header alone must read these for ever.
TEST(LeafBasis, IsTheseBytes) {
  EXPECT_EQ(Hex(LeafBasis::Of(TinyBinding())->ToBytes()),
            "010000000200000003000000020000000100000000000000"
            "01000000000000000100000001000000"  // 1 block; 0, 1 and 1 columns
            "000000000000d03f000000000000e03f0000000000000000"  // 1/4, 1/2, 0
            "000000000000e03f000000000000e03f0000000000000000"  // 1/2, 1/2, 0
            "000000000000d03f000000000000e03f0000000000000000"  // 1/4, 1/2, 0
            "01000000ffffffff00000000"  // slots 1, none, 0
            "0500"  // mean squares 2031 and 0.9: sqrt is near 2^5 and 2^0
                + Zeros(128 - 126) + "d4fec800" + Zeros(124) + "07fd" +
                Zeros(62));
}

struct BadBasis {
  const char* name;
  std::function<void(std::vector<uint8_t>&)> spoil;
  const char* message;
};

class LeafBasisRefuses : public testing::TestWithParam<BadBasis> {};

// Of the tiny basis.
constexpr size_t kLeafAt = 24, kRestAt = 40, kSlotsAt = 112, kPaddingAt = 126;

template <typename Number>
std::function<void(std::vector<uint8_t>&)> Put(size_t at, Number number) {
  return [=](std::vector<uint8_t>& bytes) {
    std::memcpy(bytes.data() + at, &number, sizeof(number));
  };
}

TEST_P(LeafBasisRefuses, AndSaysWhy) {
  std::vector<uint8_t> bytes = LeafBasis::Of(TinyBinding())->ToBytes();
  GetParam().spoil(bytes);
  const absl::Status status = LeafBasis::FromBytes(bytes, 1000).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(DetailOf(status).reason, "BAD_BASIS");
  EXPECT_EQ(DetailOf(status).field, "leaf_basis");
  EXPECT_EQ(std::string(status.message()), GetParam().message);
}

INSTANTIATE_TEST_SUITE_P(
    Bytes, LeafBasisRefuses,
    testing::ValuesIn<BadBasis>({
        {"TooMany", [](auto& bytes) { bytes.resize(1001); },
         "the basis has 1001 bytes, more than 1000 are taken"},
        {"ShortHead", [](auto& bytes) { bytes.resize(23); },
         "the basis has 23 bytes, its head alone 24"},
        {"OtherFormat", Put<uint32_t>(0, 2),
         "the basis is of format 2, only 1 is known"},
        {"Dimension", Put<uint32_t>(4, 4),
         "the basis is of dimension 4, not 2 or 3"},
        {"NoPoints", Put<uint32_t>(8, 0),
         "the basis is of 0 points, not 1 to 2147483647"},
        {"TooManyPoints", Put<uint32_t>(8, 0x80000000),
         "the basis is of 2147483648 points, not 1 to 2147483647"},
        {"MoreSlotsThanPoints", Put<uint32_t>(12, 4),
         "the basis has 4 slots for 3 points"},
        {"MoreLeavesThanBlocks", Put<uint32_t>(16, 2),
         "the basis has 2 leaves for 1 blocks"},
        {"HeadNotFilledWithZero", Put<uint32_t>(20, 1),
         "bytes 20 to 23 of the basis are not 0"},
        {"CutLeaves", [](auto& bytes) { bytes.resize(39); },
         "the basis ends within its 1 leaves, after 39 bytes"},
        {"EmptyLeaf", Put<uint32_t>(kLeafAt, 0),
         "leaf 0 of the basis has no block"},
        {"MoreBlocksThanSlots", Put<uint32_t>(kLeafAt, 2),
         "the leaves of the basis have 2 blocks, its 2 slots fill 1"},
        {"OneByteLess", [](auto& bytes) { bytes.pop_back(); },
         "the basis has 319 bytes, fewer than its 3 points and 1 leaves of 2 "
         "columns need"},
        {"OneByteMore", [](auto& bytes) { bytes.push_back(0); },
         "the basis has 321 bytes, more than its 3 points and 1 leaves of 2 "
         "columns need"},
        {"ManyColumns", Put<uint64_t>(kLeafAt + 4, ~uint64_t{0}),
         "the basis has 320 bytes, fewer than its 3 points and 1 leaves of "
         "8589934591 columns need"},
        {"ManyPoints", Put<uint32_t>(8, 0x7fffffff),
         "the basis has 320 bytes, fewer than its 2147483647 points and 1 "
         "leaves of 2 columns need"},
        {"PlaceNotFinite",
         Put(kRestAt + 8, std::numeric_limits<double>::quiet_NaN()),
         "point 0 of the basis is at nan: not finite, or beyond 1e+100"},
        {"PlaceTooFar", Put(kRestAt + 24, -1e101),
         "point 1 of the basis is at -1e+101: not finite, or beyond 1e+100"},
        {"NotPlanar", Put(kRestAt + 40, 0.5),
         "point 1 of the basis, of dimension 2, has a z of 0.5"},
        {"SlotBeyond", Put<int32_t>(kSlotsAt, 2),
         "point 0 of the basis has slot 2 of 2"},
        {"SlotBelowNone", Put<int32_t>(kSlotsAt, -2),
         "point 0 of the basis has slot -2 of 2"},
        {"SlotTwice", Put<int32_t>(kSlotsAt, 0),
         "point 2 of the basis has slot 0, which another has"},
        {"SlotOfNobody", Put<int32_t>(kSlotsAt, -1),
         "1 of the 2 slots of the basis have no point"},
        {"PaddingNotZero", Put<uint8_t>(kPaddingAt, 1),
         "the basis has other bytes than 0 before its blocks"},
        {"NumberNotFinite",
         [](auto& bytes) {
           // A column of float instead, of infinities.
           Put<uint32_t>(kLeafAt + 4, 1)(bytes);
           Put<uint32_t>(kLeafAt + 8, 0)(bytes);
           bytes.insert(bytes.end() - 192, 128, 0);
           Put(128 + 4, std::numeric_limits<float>::infinity())(bytes);
         },
         "leaf 0 of the basis has a number that is not finite"},
    }),
    [](const auto& test) { return test.param.name; });

}  // namespace
}  // namespace deform
