#include "server/models/content_id.h"

#include <gtest/gtest.h>

namespace deform::server {
namespace {

TEST(ContentHash, IsTheSha256OfLengthsAndValues) {
  // printf '\x01\0\0\0\0\0\0\0k\x01\0\0\0\0\0\0\0a' | sha256sum | cut -c 1-40
  EXPECT_EQ(ContentHash("k").Add("a").Finish(),
            "71bd3cd220331f2d419e28534f372c6a4858e89e");
}

TEST(ContentHash, TellsKindsApart) {
  EXPECT_NE(ContentHash("model").Finish(), ContentHash("binding").Finish());
}

TEST(ContentHash, DoesNotLetValuesRunTogether) {
  EXPECT_NE(ContentHash("k").Add("ab").Add("c").Finish(),
            ContentHash("k").Add("a").Add("bc").Finish());
}

TEST(ContentHash, TakesAValueInPartsHoweverItIsCut) {
  const std::string text = "abcdef";
  const auto bytes = std::as_bytes(std::span(text));
  const std::span<const std::byte> whole[] = {bytes};
  const std::span<const std::byte> parts[] = {
      bytes.first(1), bytes.subspan(1, 3), bytes.subspan(4)};
  const std::string id = ContentHash("k").Add(text).Finish();
  EXPECT_EQ(ContentHash("k").AddParts(whole).Finish(), id);
  EXPECT_EQ(ContentHash("k").AddParts(parts).Finish(), id);
}

TEST(ContentHash, SeesEveryNumber) {
  Positions a = Positions::Zero(2, 3);
  Positions b = a;
  b(1, 2) = 1e-300;
  EXPECT_NE(ContentHash("k").Add(a).Finish(), ContentHash("k").Add(b).Finish());
  EXPECT_EQ(ContentHash("k").Add(a).Finish(), ContentHash("k").Add(a).Finish());
}

}  // namespace
}  // namespace deform::server
