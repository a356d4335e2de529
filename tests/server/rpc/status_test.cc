#include "server/rpc/status.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>

#include "core/base/error.h"
#include "google/rpc/error_details.pb.h"
#include "server/models/memory_budget.h"

namespace deform::server {
namespace {

template <typename Detail>
std::optional<Detail> Find(const google::rpc::Status& status) {
  for (const auto& any : status.details()) {
    Detail detail;
    if (any.UnpackTo(&detail)) return detail;
  }
  return std::nullopt;
}

google::rpc::Status Rpc(absl::StatusCode code, const ErrorDetail& detail) {
  return ToRpcStatus(MakeError(code, "what to mend", detail));
}

TEST(Status, OkIsOk) {
  EXPECT_TRUE(ToGrpcStatus(absl::OkStatus()).ok());
  EXPECT_EQ(ToRpcStatus(absl::OkStatus()).code(), 0);
}

TEST(Status, CarriesTheReason) {
  const auto status =
      Rpc(absl::StatusCode::kFailedPrecondition, {.reason = "MODEL_IN_USE"});
  EXPECT_EQ(status.code(), 9);
  EXPECT_EQ(status.message(), "what to mend");
  const auto info = Find<google::rpc::ErrorInfo>(status);
  EXPECT_EQ(info->reason(), "MODEL_IN_USE");
  EXPECT_EQ(info->domain(), "deformd");
}

TEST(Status, AnErrorWithoutReasonHasItsCodesName) {
  const auto status = ToRpcStatus(absl::CancelledError());
  EXPECT_EQ(Find<google::rpc::ErrorInfo>(status)->reason(), "CANCELLED");
}

TEST(Status, NamesTheFieldOfABadRequest) {
  const auto status = Rpc(absl::StatusCode::kInvalidArgument,
                          {.reason = "X", .field = "rig.cage.corners"});
  const auto bad = Find<google::rpc::BadRequest>(status);
  EXPECT_EQ(bad->field_violations(0).field(), "rig.cage.corners");
  EXPECT_EQ(bad->field_violations(0).description(), "what to mend");
  EXPECT_FALSE(Find<google::rpc::QuotaFailure>(status));
}

TEST(Status, NamesTheLimitThatWasMet) {
  const auto status = Rpc(absl::StatusCode::kResourceExhausted,
                          {.reason = "X", .field = "max-models"});
  const auto quota = Find<google::rpc::QuotaFailure>(status);
  EXPECT_EQ(quota->violations(0).subject(), "max-models");
  EXPECT_EQ(quota->violations(0).description(), "what to mend");
  EXPECT_FALSE(Find<google::rpc::BadRequest>(status));
}

TEST(Status, NamesTheResource) {
  const auto status =
      Rpc(absl::StatusCode::kNotFound,
          {.reason = "X", .resource_type = "model", .resource_name = "m-1"});
  const auto resource = Find<google::rpc::ResourceInfo>(status);
  EXPECT_EQ(resource->resource_type(), "model");
  EXPECT_EQ(resource->resource_name(), "m-1");
}

TEST(Status, SaysWhenTryingAgainMayHelp) {
  const auto status =
      Rpc(absl::StatusCode::kUnavailable, {.reason = "SERVER_DRAINING"});
  EXPECT_EQ(Find<google::rpc::RetryInfo>(status)->retry_delay().seconds(), 1);
  EXPECT_FALSE(Find<google::rpc::RetryInfo>(
      Rpc(absl::StatusCode::kNotFound, {.reason = "X"})));
}

TEST(Status, SaysThatMemoryMayBeFreeLaterUnlessTheLimitIsTooLow) {
  MemoryBudget budget(100, "limit");
  const auto held = budget.Reserve(60, "it needs").value();
  EXPECT_TRUE(Find<google::rpc::RetryInfo>(
      ToRpcStatus(budget.Reserve(50, "it needs").status())));
  EXPECT_FALSE(Find<google::rpc::RetryInfo>(
      ToRpcStatus(budget.Reserve(101, "it needs").status())));
}

TEST(Status, TravelsInTheDetailsOfACall) {
  const grpc::Status status = ToGrpcStatus(MakeError(
      absl::StatusCode::kNotFound, "no model", {.reason = "MODEL_NOT_FOUND"}));
  EXPECT_EQ(status.error_code(), grpc::StatusCode::NOT_FOUND);
  EXPECT_EQ(status.error_message(), "no model");
  google::rpc::Status rpc;
  ASSERT_TRUE(rpc.ParseFromString(status.error_details()));
  EXPECT_EQ(Find<google::rpc::ErrorInfo>(rpc)->reason(), "MODEL_NOT_FOUND");
}

TEST(Status, FitsIntoTrailers) {
  // Two bytes a character: the cut must not split one.
  std::string message = "x";
  for (int i = 0; i < 10'000; ++i) message += "\xc3\xa9";
  const grpc::Status status = ToGrpcStatus(InvalidInput("X", "f", message));
  EXPECT_EQ(status.error_message().size(), 999 + 3);
  EXPECT_LT(status.error_details().size(), 4096u);
}

}  // namespace
}  // namespace deform::server
