#include "core/weights/scheme.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <string>

#include "core/base/error.h"

namespace deform {
namespace {

TEST(Schemes, AreFoundByTheirIds) {
  for (const CoordinateScheme* scheme : AllSchemes()) {
    const auto found = FindScheme(scheme->id());
    ASSERT_TRUE(found.ok()) << scheme->id();
    EXPECT_EQ(*found, scheme);
  }
}

TEST(Schemes, HaveDifferentIds) {
  std::set<std::string> ids;
  for (const CoordinateScheme* scheme : AllSchemes()) {
    EXPECT_TRUE(ids.insert(std::string(scheme->id())).second) << scheme->id();
  }
}

TEST(Schemes, AnUnknownOneIsAnErrorThatListsTheKnown) {
  const absl::Status status = FindScheme("blue").status();
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(DetailOf(status).reason, "UNKNOWN_SCHEME");
  EXPECT_THAT(std::string(status.message()),
              testing::StartsWith(
                  "no scheme is called \"blue\"; this server knows green"));
}

}  // namespace
}  // namespace deform
