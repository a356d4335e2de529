#include "core/base/error.h"

#include <gtest/gtest.h>

namespace deform {
namespace {

TEST(Error, KeepsItsDetail) {
  const absl::Status status =
      InvalidInput("BAD_INDEX", "rig.cage.corners", "face 3 refers to nothing");
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(status.message(), "face 3 refers to nothing");
  EXPECT_EQ(DetailOf(status).reason, "BAD_INDEX");
  EXPECT_EQ(DetailOf(status).field, "rig.cage.corners");
  EXPECT_EQ(DetailOf(status).resource_name, "");
}

TEST(Error, IsEmptyWhereNoneWasGiven) {
  EXPECT_EQ(DetailOf(absl::InternalError("x")).reason, "");
}

TEST(Error, AnnotatingKeepsCodeAndDetail) {
  const absl::Status status =
      Annotate(InvalidInput("R", "f", "message"), "while binding: ");
  EXPECT_EQ(status.message(), "while binding: message");
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(DetailOf(status).reason, "R");
}

}  // namespace
}  // namespace deform
