#include "server/models/names.h"

#include <gtest/gtest.h>

#include "core/base/error.h"

namespace deform::server {
namespace {

TEST(Names, AreShortAndPlain) {
  EXPECT_TRUE(CheckName("a", "id").ok());
  EXPECT_TRUE(CheckName("Heart_2-b", "id").ok());
  EXPECT_TRUE(CheckName(std::string(64, 'x'), "id").ok());
  for (const std::string& bad :
       {std::string(), std::string(65, 'x'), std::string("a b"),
        std::string("../x"), std::string("\xc3\xa9"), std::string("a\0b", 3)}) {
    const absl::Status status = CheckName(bad, "session_id");
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << bad;
    EXPECT_EQ(DetailOf(status).reason, "BAD_NAME") << bad;
    EXPECT_EQ(DetailOf(status).field, "session_id") << bad;
  }
  EXPECT_EQ(CheckName("a b", "session_id").message(),
            "session_id \"a b\" is not 1 to 64 of the characters A-Z a-z 0-9 _ "
            "-");
}

TEST(Names, AreCutAndEscapedInMessages) {
  EXPECT_EQ(Quoted("x\n\xff"), "\"x\\n\\xff\"");
  EXPECT_EQ(Quoted(std::string(1000, 'x')),
            "\"" + std::string(64, 'x') + "...\"");
}

TEST(Names, AnEmptyTenantIsTheDefaultOne) {
  EXPECT_EQ(TenantOr("").value(), "default");
  EXPECT_EQ(TenantOr("clinic-7").value(), "clinic-7");
  EXPECT_EQ(DetailOf(TenantOr("a/b").status()).field, "tenant");
}

}  // namespace
}  // namespace deform::server
