#include "client/cpp/status.h"

#include <gtest/gtest.h>

#include "core/base/error.h"
#include "google/rpc/error_details.pb.h"

namespace deform {
namespace {

google::rpc::Status WireStatus() {
  google::rpc::Status wire;
  wire.set_code(3);
  wire.set_message("face 3 refers to vertex 8 of 8");
  google::rpc::ErrorInfo info;
  info.set_reason("INDEX_OUT_OF_RANGE");
  info.set_domain("deformd");
  wire.add_details()->PackFrom(info);
  google::rpc::BadRequest request;
  request.add_field_violations()->set_field("rig.cage.corners");
  wire.add_details()->PackFrom(request);
  google::rpc::ResourceInfo resource;
  resource.set_resource_type("model");
  resource.set_resource_name("m-1");
  wire.add_details()->PackFrom(resource);
  return wire;
}

TEST(Status, KeepsCodeMessageAndDetail) {
  const google::rpc::Status wire = WireStatus();
  const absl::Status status =
      FromGrpc(grpc::Status(grpc::StatusCode::INVALID_ARGUMENT, wire.message(),
                            wire.SerializeAsString()));
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(status.message(), "face 3 refers to vertex 8 of 8");
  EXPECT_EQ(DetailOf(status).reason, "INDEX_OUT_OF_RANGE");
  EXPECT_EQ(DetailOf(status).field, "rig.cage.corners");
  EXPECT_EQ(DetailOf(status).resource_type, "model");
  EXPECT_EQ(DetailOf(status).resource_name, "m-1");
}

TEST(Status, ReadsTheSameFromWithinAMessage) {
  EXPECT_EQ(DetailOf(FromRpcStatus(WireStatus())).reason, "INDEX_OUT_OF_RANGE");
}

TEST(Status, SurvivesDetailsThatAreGarbage) {
  const absl::Status status = FromGrpc(grpc::Status(
      grpc::StatusCode::INTERNAL, "broken", "\xff\xff\xff garbage"));
  EXPECT_EQ(status.code(), absl::StatusCode::kInternal);
  EXPECT_EQ(DetailOf(status).reason, "");
}

TEST(Status, AnUnknownCodeIsUnknown) {
  google::rpc::Status wire;
  wire.set_code(99);
  EXPECT_EQ(FromRpcStatus(wire).code(), absl::StatusCode::kUnknown);
}

TEST(Status, ABrokenConnectionIsToldFromABusyServer) {
  EXPECT_EQ(DetailOf(FromGrpc(grpc::Status(grpc::StatusCode::UNAVAILABLE,
                                           "failed to connect")))
                .reason,
            "SERVER_UNREACHABLE");
  google::rpc::Status wire;
  google::rpc::ErrorInfo info;
  info.set_reason("DRAINING");
  wire.add_details()->PackFrom(info);
  EXPECT_EQ(
      DetailOf(FromGrpc(grpc::Status(grpc::StatusCode::UNAVAILABLE, "draining",
                                     wire.SerializeAsString())))
          .reason,
      "DRAINING");
}

}  // namespace
}  // namespace deform
