#include "core/weights/binding.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "core/base/error.h"
#include "tests/support/shapes.h"

namespace deform {
namespace {

using testing::HasSubstr;

BindRequest SphereInCube() {
  return {.model = std::make_shared<const Mesh>(MeshOf(Icosphere(0.9, 3))),
          .rig = CageOf(Cuboid({-1, -1, -1}, {1, 1, 1})),
          .scheme = "green"};
}

TEST(Bind, ReproducesThePointsAtRest) {
  const auto binding = Bind(SphereInCube(), {});
  ASSERT_TRUE(binding.ok()) << binding.status();
  EXPECT_EQ((*binding)->point_count(), 642);
  EXPECT_EQ((*binding)->vertex_count(), 8);
  EXPECT_EQ((*binding)->normal_count(), 12);
  EXPECT_EQ((*binding)->unbound_count(), 0);
  // Double weights; the closed forms lose at most a few units in the last
  // place.
  EXPECT_LT((*binding)->quality().reproduction_error, 1e-14);
  EXPECT_GE((*binding)->quality().weight_sum_max, 1);
  EXPECT_GE((*binding)->compute_seconds(), 0);
}

TEST(Bind, AnUnknownSchemeIsNotFound) {
  BindRequest request = SphereInCube();
  request.scheme = "blue";
  const absl::Status status = Bind(request, {}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(status.message()), HasSubstr("\"blue\""));
}

}  // namespace
}  // namespace deform
